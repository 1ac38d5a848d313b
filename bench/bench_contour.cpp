/* Configures VTK for speed: it merges no points and computes no normals and scalars, so its default flat shading uses
 * the triangles' own normals. The grid borrows the caller's arrays, the window and its context are kept, and a new
 * surface replaces the previous one. */
#include "bench_contour.h"

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <malloc.h>
#include <vector>

#include <vtkAutoInit.h>
#include <vtkCamera.h>
#include <vtkCellArray.h>
#include <vtkContour3DLinearGrid.h>
#include <vtkFloatArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkSMPTools.h>
#include <vtkTypeInt32Array.h>
#include <vtkUnstructuredGrid.h>

VTK_MODULE_INIT(vtkRenderingOpenGL2)

struct bench_contour {
    bench_contour_mesh mesh;
    vtkNew<vtkPoints> points;
    vtkNew<vtkFloatArray> xyz, values;
    vtkNew<vtkUnstructuredGrid> grid;
    vtkNew<vtkContour3DLinearGrid> filter;
    vtkNew<vtkPolyData> surface; /* most recent result of the filter */
    vtkNew<vtkPolyDataMapper> mapper;
    vtkNew<vtkActor> actor;
    vtkNew<vtkRenderer> renderer;
    vtkNew<vtkRenderWindow> window;
    std::vector<float> padded;
};

namespace
{

void set_cells(bench_contour &c)
{
    const int size = c.mesh.cell_type == VTK_TETRA ? 4 : 8;
    vtkNew<vtkTypeInt32Array> offsets, connectivity;
    vtkNew<vtkCellArray> cells;
    offsets->SetNumberOfValues(c.mesh.cell_count + 1);
    for (vtkIdType i = 0; i <= c.mesh.cell_count; i++) offsets->SetValue(i, static_cast<int32_t>(size * i));
    connectivity->SetArray(const_cast<int32_t *>(c.mesh.connectivity), size * c.mesh.cell_count, 1);
    cells->SetData(offsets, connectivity);
    c.grid->SetCells(c.mesh.cell_type, cells);
}

void set_view(bench_contour &c, const bench_contour_view &view)
{
    vtkCamera *camera = c.renderer->GetActiveCamera();
    camera->SetPosition(view.eye);
    camera->SetFocalPoint(view.focal);
    camera->SetViewUp(view.up);
    camera->SetViewAngle(view.degrees);
    c.mapper->ScalarVisibilityOff();
    c.actor->SetMapper(c.mapper);
    c.actor->GetProperty()->SetColor(0.8, 0.7, 0.5);
    c.renderer->AddActor(c.actor);
    c.window->SetOffScreenRendering(1);
    c.window->SetMultiSamples(0);
    c.window->SetSize(view.width, view.height);
    c.window->AddRenderer(c.renderer);
}

} // namespace

bool bench_contour_is_available(void)
{
    return true;
}

bench_contour *bench_contour_create(const bench_contour_mesh *mesh, const bench_contour_view *view, int threads)
{
    auto *c = new bench_contour();
    c->mesh = *mesh;
    vtkSMPTools::Initialize(threads);
    c->xyz->SetNumberOfComponents(3);
    c->points->SetData(c->xyz);
    c->grid->SetPoints(c->points);
    c->grid->GetPointData()->SetScalars(c->values);
    bench_contour_set(c, mesh->xyz, mesh->values);
    set_cells(*c);
    c->filter->SetInputData(c->grid);
    c->filter->MergePointsOff();
    c->filter->ComputeNormalsOff();
    c->filter->ComputeScalarsOff();
    c->filter->InterpolateAttributesOff();
    set_view(*c, *view);
    return c;
}

void bench_contour_destroy(bench_contour *contour)
{
    delete contour;
}

bool bench_contour_can_draw(bench_contour *c)
{
    /* VTK aborts the process if there is no X server. */
    if (!std::getenv("DISPLAY") || !c->window->SupportsOpenGL()) return false;
    c->window->Render();
    return true;
}

void bench_contour_set(bench_contour *c, const float *xyz, const float *values)
{
    c->xyz->SetArray(const_cast<float *>(xyz), 3 * c->mesh.vertex_count, 1);
    c->values->SetArray(const_cast<float *>(values), c->mesh.vertex_count, 1);
    c->xyz->Modified();
    c->values->Modified();
    c->points->Modified();
    c->grid->Modified();
}

bench_triangles bench_contour_extract(bench_contour *c, const double *isovalues, int count)
{
    c->filter->SetNumberOfContours(count);
    for (int i = 0; i < count; i++) c->filter->SetValue(i, isovalues[i]);
    c->filter->Modified();
    c->filter->Update();
    c->surface->ShallowCopy(c->filter->GetOutputDataObject(0));
    const vtkIdType floats = 3 * c->surface->GetNumberOfPoints();
    auto *xyz = static_cast<float *>(c->surface->GetPoints()->GetVoidPointer(0));
    const size_t bytes = static_cast<size_t>(floats) * sizeof(float);
    if (floats && malloc_usable_size(xyz) < bytes + 4) {
        c->padded.resize(static_cast<size_t>(floats) + 1);
        std::memcpy(c->padded.data(), xyz, bytes);
        xyz = c->padded.data();
    }
    return {floats / 9, xyz};
}

void bench_contour_draw(bench_contour *c)
{
    if (c->mapper->GetInput() != c->surface) c->mapper->SetInputData(c->surface);
    c->renderer->ResetCameraClippingRange();
    c->window->Render();
    c->window->WaitForCompletion();
}

void bench_contour_read_depths(bench_contour *c, float *depths)
{
    const int *size = c->window->GetSize(), width = size[0], height = size[1];
    double range[2];
    c->renderer->GetActiveCamera()->GetClippingRange(range);
    std::vector<float> z(static_cast<size_t>(width) * static_cast<size_t>(height));
    c->window->GetZbufferData(0, 0, width - 1, height - 1, z.data());
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const float at =
                z[static_cast<size_t>(height - 1 - y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
            const double ndc = 2 * static_cast<double>(at) - 1, near = range[0], far = range[1];
            const double depth = at < 1 ? 2 * far * near / (far + near - ndc * (far - near)) : INFINITY;
            *depths++ = static_cast<float>(depth);
        }
}
