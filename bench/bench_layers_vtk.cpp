#include "bench_layers_vtk.h"

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include <vtk3DLinearGridPlaneCutter.h>
#include <vtkActor.h>
#include <vtkAutoInit.h>
#include <vtkCamera.h>
#include <vtkCellArray.h>
#include <vtkContour3DLinearGrid.h>
#include <vtkContourFilter.h>
#include <vtkFloatArray.h>
#include <vtkGeometryFilter.h>
#include <vtkGradientFilter.h>
#include <vtkNew.h>
#include <vtkPlane.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkReflectionFilter.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkRendererCollection.h>
#include <vtkSMPTools.h>
#include <vtkTableBasedClipDataSet.h>
#include <vtkTypeInt32Array.h>
#include <vtkUnstructuredGrid.h>
#include <vtkWarpVector.h>

VTK_MODULE_INIT(vtkRenderingOpenGL2)

enum { VIEWS = 4 };

struct bench_layers_vtk {
    bench_contour_mesh mesh;
    bench_layers_parameters parameters;
    vtkNew<vtkFloatArray> xyz, values, velocities;
    vtkNew<vtkUnstructuredGrid> grid;
    vtkNew<vtkPlane> plane;
    vtkNew<vtk3DLinearGridPlaneCutter> cutter;
    std::vector<vtkSmartPointer<vtk3DLinearGridPlaneCutter>> planes;
    vtkNew<vtkTableBasedClipDataSet> clipper;
    vtkNew<vtkGradientFilter> gradient;
    vtkNew<vtkWarpVector> warp;
    vtkNew<vtkReflectionFilter> mirror;
    vtkNew<vtkGeometryFilter> surface, clipped, warped, mirrored;
    vtkNew<vtkContour3DLinearGrid> isosurface, vortices;
    vtkNew<vtkContourFilter> slice_lines, surface_lines;
    vtkNew<vtkRenderer> renderers[BENCH_LAYER_COUNT]; /* for all pictures except the montage */
    vtkNew<vtkRenderer> views[VIEWS];                 /* for the montage */
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
    l.values->SetName("f");
    l.velocities->SetName("v");
    l.velocities->SetNumberOfComponents(3);
    l.grid->GetPointData()->SetScalars(l.values);
    offsets->SetNumberOfValues(l.mesh.cell_count + 1);
    for (vtkIdType i = 0; i <= l.mesh.cell_count; i++) offsets->SetValue(i, static_cast<int32_t>(size * i));
    connectivity->SetArray(const_cast<int32_t *>(l.mesh.connectivity), size * l.mesh.cell_count, 1);
    cells->SetData(offsets, connectivity);
    l.grid->SetCells(l.mesh.cell_type, cells);
}

void set_cutter(vtk3DLinearGridPlaneCutter *cutter, vtkUnstructuredGrid *grid, vtkPlane *plane)
{
    cutter->SetInputData(grid);
    cutter->SetPlane(plane);
    cutter->MergePointsOff();
    cutter->InterpolateAttributesOn();
    cutter->ComputeNormalsOff();
}

/* Adds planes at the centres of layers of equal thickness across the cube [-1, 1]^3. */
void set_planes(bench_layers_vtk &l)
{
    const double *n = l.parameters.plane;
    const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    const double reach = (std::abs(n[0]) + std::abs(n[1]) + std::abs(n[2])) / length;
    for (int i = 0; i < l.parameters.plane_count; i++) {
        const double at = reach * (2 * (i + 0.5) / l.parameters.plane_count - 1) / length;
        vtkNew<vtkPlane> plane;
        plane->SetNormal(n);
        plane->SetOrigin(at * n[0], at * n[1], at * n[2]);
        l.planes.push_back(vtkSmartPointer<vtk3DLinearGridPlaneCutter>::New());
        set_cutter(l.planes.back(), l.grid, plane);
    }
}

void set_isosurface(vtkContour3DLinearGrid *filter, double value)
{
    filter->MergePointsOff();
    filter->ComputeNormalsOff();
    filter->ComputeScalarsOff();
    filter->InterpolateAttributesOff();
    filter->SetValue(0, value);
}

/* Sets isovalues that divide the range into parts of equal width, as scenes do. */
void set_lines(vtkContourFilter *filter, vtkAlgorithm *surface, const bench_layers_parameters &p)
{
    filter->SetInputConnection(surface->GetOutputPort());
    const double step = (p.range[1] - p.range[0]) / (p.line_count + 1);
    for (int i = 0; i < p.line_count; i++) filter->SetValue(i, p.range[0] + (i + 1) * step);
}

void set_layers(bench_layers_vtk &l)
{
    l.plane->SetNormal(l.parameters.plane);
    set_cutter(l.cutter, l.grid, l.plane);
    set_planes(l);
    l.surface->SetInputData(l.grid);
    l.clipper->SetInputData(l.grid);
    l.clipper->SetClipFunction(l.plane);
    l.clipper->InsideOutOn();
    l.clipped->SetInputConnection(l.clipper->GetOutputPort());
    l.isosurface->SetInputData(l.grid);
    set_isosurface(l.isosurface, l.parameters.isovalue);
    set_lines(l.slice_lines, l.cutter, l.parameters);
    set_lines(l.surface_lines, l.surface, l.parameters);
}

void set_filters_of_velocities(bench_layers_vtk &l)
{
    const int points = vtkDataObject::FIELD_ASSOCIATION_POINTS;
    l.gradient->SetInputData(l.grid);
    l.gradient->SetInputScalars(points, "v");
    l.gradient->ComputeGradientOff();
    l.gradient->ComputeQCriterionOn();
    l.vortices->SetInputConnection(l.gradient->GetOutputPort());
    l.vortices->SetInputArrayToProcess(0, 0, 0, points, "Q-criterion");
    set_isosurface(l.vortices, l.parameters.vortex);
    l.warp->SetInputData(l.grid);
    l.warp->SetInputArrayToProcess(0, 0, 0, points, "v");
    l.warp->SetScaleFactor(l.parameters.warp);
    l.warped->SetInputConnection(l.warp->GetOutputPort());
    l.mirror->SetInputData(l.grid);
    l.mirror->SetPlaneToX();
    l.mirror->SetCenter(l.parameters.mirror);
    l.mirrored->SetInputConnection(l.mirror->GetOutputPort());
}

enum class style { coloured, shaded, line };

void add_actor(const bench_layers_vtk &l, vtkRenderer *renderer, vtkAlgorithm *filter, style how)
{
    vtkNew<vtkPolyDataMapper> mapper;
    vtkNew<vtkActor> actor;
    mapper->SetInputConnection(filter->GetOutputPort());
    mapper->SetScalarRange(l.parameters.range);
    mapper->SetScalarVisibility(how == style::coloured);
    actor->SetMapper(mapper);
    if (how != style::shaded) actor->GetProperty()->LightingOff();
    if (how == style::shaded) actor->GetProperty()->SetColor(0.8, 0.7, 0.5);
    if (how == style::line) actor->GetProperty()->SetColor(0, 0, 0);
    if (how == style::line) actor->GetProperty()->SetLineWidth(2);
    renderer->AddActor(actor);
}

void add_actors(bench_layers_vtk &l)
{
    const auto add = [&l](bench_layer layer, vtkAlgorithm *filter, style how) {
        add_actor(l, l.renderers[layer], filter, how);
    };
    add(BENCH_LAYER_SLICE, l.cutter, style::coloured);
    add(BENCH_LAYER_SURFACE, l.surface, style::coloured);
    add(BENCH_LAYER_CLIPPED, l.clipped, style::coloured);
    add(BENCH_LAYER_VORTICES, l.vortices, style::shaded);
    add(BENCH_LAYER_LINED_SLICE, l.cutter, style::coloured);
    add(BENCH_LAYER_LINED_SLICE, l.slice_lines, style::line);
    add(BENCH_LAYER_LINED_SURFACE, l.surface, style::coloured);
    add(BENCH_LAYER_LINED_SURFACE, l.surface_lines, style::line);
    add(BENCH_LAYER_WARPED, l.warped, style::coloured);
    add(BENCH_LAYER_MIRRORED, l.mirrored, style::coloured);
    for (const auto &plane : l.planes) add(BENCH_LAYER_PLANES, plane, style::coloured);
    vtkAlgorithm *const parts[VIEWS] = {l.cutter, l.surface, l.clipped, l.isosurface};
    for (int i = 0; i < VIEWS; i++) add_actor(l, l.views[i], parts[i], i < VIEWS - 1 ? style::coloured : style::shaded);
}

void set_camera(vtkRenderer *renderer, const bench_contour_view &view)
{
    vtkCamera *camera = renderer->GetActiveCamera();
    camera->SetPosition(view.eye);
    camera->SetFocalPoint(view.focal);
    camera->SetViewUp(view.up);
    camera->SetViewAngle(view.degrees);
}

void set_window(bench_layers_vtk &l, const bench_contour_view &view)
{
    for (const auto &renderer : l.renderers) set_camera(renderer, view);
    for (int i = 0; i < VIEWS; i++) {
        set_camera(l.views[i], view);
        l.views[i]->SetViewport(0.5 * (i % 2), 0.5 * (i / 2), 0.5 * (i % 2) + 0.5, 0.5 * (i / 2) + 0.5);
    }
    vtkMapper::SetResolveCoincidentTopologyToPolygonOffset(); /* draws lines in front of their surface */
    l.window->SetOffScreenRendering(1);
    l.window->SetMultiSamples(0);
    l.window->SetSize(view.width, view.height);
}

} // namespace

bool bench_layers_vtk_is_available(void)
{
    return std::getenv("DISPLAY") != nullptr; /* VTK aborts the process if there is no X server */
}

bench_layers_vtk *bench_layers_vtk_create(const bench_contour_mesh *mesh, const bench_contour_view *view,
                                          const bench_layers_parameters *parameters, int threads)
{
    auto *l = new bench_layers_vtk();
    l->mesh = *mesh;
    l->parameters = *parameters;
    vtkSMPTools::Initialize(threads);
    set_grid(*l);
    bench_layers_vtk_set(l, mesh->values, nullptr);
    set_layers(*l);
    set_filters_of_velocities(*l);
    add_actors(*l);
    set_window(*l, *view);
    bench_layers_vtk_draw(l, BENCH_LAYER_SLICE);
    return l;
}

void bench_layers_vtk_destroy(bench_layers_vtk *layers)
{
    delete layers;
}

void bench_layers_vtk_set(bench_layers_vtk *l, const float *values, const float *velocities)
{
    l->values->SetArray(const_cast<float *>(values), l->mesh.vertex_count, 1);
    l->values->Modified();
    l->velocities->SetArray(const_cast<float *>(velocities), velocities ? 3 * l->mesh.vertex_count : 0, 1);
    l->velocities->Modified();
    if (velocities)
        l->grid->GetPointData()->AddArray(l->velocities);
    else
        l->grid->GetPointData()->RemoveArray("v"); /* prevents filters from copying it */
    l->grid->Modified();
}

void bench_layers_vtk_draw(bench_layers_vtk *l, bench_layer layer)
{
    const bool is_montage = layer == BENCH_LAYER_MONTAGE;
    if (layer == BENCH_LAYER_Q_CRITERION) {
        l->gradient->Update();
        return;
    }
    l->window->GetRenderers()->RemoveAllItems();
    for (int i = 0; i < (is_montage ? VIEWS : 1); i++) {
        vtkRenderer *renderer = is_montage ? l->views[i] : l->renderers[layer];
        l->window->AddRenderer(renderer);
        renderer->ResetCameraClippingRange();
    }
    l->window->Render();
    l->window->WaitForCompletion();
}
