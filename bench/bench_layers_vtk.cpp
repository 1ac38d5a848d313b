#include "bench_layers_vtk.h"

#include <cstdint>
#include <cstdlib>

#include <vtkActor.h>
#include <vtkAutoInit.h>
#include <vtkCamera.h>
#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkGeometryFilter.h>
#include <vtkNew.h>
#include <vtk3DLinearGridPlaneCutter.h>
#include <vtkPlane.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkSMPTools.h>
#include <vtkTableBasedClipDataSet.h>
#include <vtkTypeInt32Array.h>
#include <vtkUnstructuredGrid.h>

VTK_MODULE_INIT(vtkRenderingOpenGL2)

struct bench_layers_vtk {
    bench_contour_mesh mesh;
    vtkNew<vtkFloatArray> xyz, values;
    vtkNew<vtkUnstructuredGrid> grid;
    vtkNew<vtkPlane> plane;
    vtkNew<vtk3DLinearGridPlaneCutter> cutter;
    vtkNew<vtkTableBasedClipDataSet> clipper;
    vtkNew<vtkGeometryFilter> surface, clipped;
    vtkNew<vtkPolyDataMapper> mapper;
    vtkNew<vtkActor> actor;
    vtkNew<vtkRenderer> renderer;
    vtkNew<vtkRenderWindow> window;
};

namespace
{

void set_grid(bench_layers_vtk &l)
{
    const int size = l.mesh.cell_type == VTK_TETRA ? 4 : 8;
    vtkNew<vtkTypeInt32Array> offsets, connectivity;
    vtkNew<vtkCellArray> cells;
    vtkNew<vtkPoints> points;
    l.xyz->SetNumberOfComponents(3);
    l.xyz->SetArray(const_cast<float *>(l.mesh.xyz), 3 * l.mesh.vertex_count, 1);
    points->SetData(l.xyz);
    l.grid->SetPoints(points);
    l.grid->GetPointData()->SetScalars(l.values);
    offsets->SetNumberOfValues(l.mesh.cell_count + 1);
    for (vtkIdType i = 0; i <= l.mesh.cell_count; i++) offsets->SetValue(i, static_cast<int32_t>(size * i));
    connectivity->SetArray(const_cast<int32_t *>(l.mesh.connectivity), size * l.mesh.cell_count, 1);
    cells->SetData(offsets, connectivity);
    l.grid->SetCells(l.mesh.cell_type, cells);
}

void set_filters(bench_layers_vtk &l)
{
    l.cutter->SetInputData(l.grid);
    l.cutter->SetPlane(l.plane);
    l.cutter->MergePointsOff();
    l.cutter->InterpolateAttributesOn();
    l.cutter->ComputeNormalsOff();
    l.surface->SetInputData(l.grid);
    l.clipper->SetInputData(l.grid);
    l.clipper->SetClipFunction(l.plane);
    l.clipper->InsideOutOn();
    l.clipped->SetInputConnection(l.clipper->GetOutputPort());
}

void set_view(bench_layers_vtk &l, const bench_contour_view &view)
{
    vtkCamera *camera = l.renderer->GetActiveCamera();
    camera->SetPosition(view.eye);
    camera->SetFocalPoint(view.focal);
    camera->SetViewUp(view.up);
    camera->SetViewAngle(view.degrees);
    l.mapper->SetScalarRange(-1.5, 1.5);
    l.actor->SetMapper(l.mapper);
    l.actor->GetProperty()->LightingOff();
    l.renderer->AddActor(l.actor);
    l.window->SetOffScreenRendering(1);
    l.window->SetMultiSamples(0);
    l.window->SetSize(view.width, view.height);
    l.window->AddRenderer(l.renderer);
}

} // namespace

bool bench_layers_vtk_is_available(void)
{
    return std::getenv("DISPLAY") != nullptr; /* without a server VTK aborts the process */
}

bench_layers_vtk *bench_layers_vtk_create(const bench_contour_mesh *mesh, const bench_contour_view *view,
                                          const double normal[3], int threads)
{
    auto *l = new bench_layers_vtk();
    l->mesh = *mesh;
    vtkSMPTools::Initialize(threads);
    l->plane->SetNormal(normal);
    bench_layers_vtk_set(l, mesh->values);
    set_grid(*l);
    set_filters(*l);
    set_view(*l, *view);
    l->window->Render();
    return l;
}

void bench_layers_vtk_destroy(bench_layers_vtk *layers)
{
    delete layers;
}

void bench_layers_vtk_set(bench_layers_vtk *l, const float *values)
{
    l->values->SetArray(const_cast<float *>(values), l->mesh.vertex_count, 1);
    l->values->Modified();
    l->grid->Modified();
}

void bench_layers_vtk_draw(bench_layers_vtk *l, bench_layer layer)
{
    if (layer == BENCH_LAYER_SLICE)
        l->mapper->SetInputConnection(l->cutter->GetOutputPort());
    else
        l->mapper->SetInputConnection((layer == BENCH_LAYER_SURFACE ? l->surface : l->clipped)->GetOutputPort());
    l->mapper->Update();
    l->renderer->ResetCameraClippingRange();
    l->window->Render();
    l->window->WaitForCompletion();
}
