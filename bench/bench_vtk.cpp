/* Draws by VTK's volume mappers.
 *
 * Debian's VTK draws through X and OpenGL. Its ray casters run on the CPU and finally show their picture as a texture,
 * so the X server may be Xvfb. Whole renders are timed. An empty render precedes them and creates the OpenGL context.
 *
 * The ray cast mapper stores only 8 bits per channel. Therefore the same rays are cast a second time, untimed, by the
 * same function and integrator, to obtain colours in float. Z-sweep stores a float image, the fixed-point mapper 15
 * bits, and projected tetrahedra have the precision of the frame buffer. */
#include "bench_vtk.h"
#include "bench_vtk_mesh.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include <vtkAutoInit.h>
#include <vtkCamera.h>
#include <vtkCellData.h>
#include <vtkColorTransferFunction.h>
#include <vtkDataSetTriangleFilter.h>
#include <vtkDoubleArray.h>
#include <vtkFixedPointRayCastImage.h>
#include <vtkFixedPointVolumeRayCastMapper.h>
#include <vtkFloatArray.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkObject.h>
#include <vtkPiecewiseFunction.h>
#include <vtkPointData.h>
#include <vtkProjectedTetrahedraMapper.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkResampleToImage.h>
#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>
#include <vtkUnstructuredGridLinearRayIntegrator.h>
#include <vtkUnstructuredGridPartialPreIntegration.h>
#include <vtkUnstructuredGridVolumeRayCastFunction.h>
#include <vtkUnstructuredGridVolumeRayCastIterator.h>
#include <vtkUnstructuredGridVolumeRayCastMapper.h>
#include <vtkUnstructuredGridVolumeZSweepMapper.h>
#include <vtkVolume.h>
#include <vtkVolumeProperty.h>

VTK_MODULE_INIT(vtkRenderingOpenGL2)
VTK_MODULE_INIT(vtkRenderingVolumeOpenGL2)

namespace
{

class zsweep_mapper : public vtkUnstructuredGridVolumeZSweepMapper
{
  public:
    static zsweep_mapper *New();
    vtkTypeMacro(zsweep_mapper, vtkUnstructuredGridVolumeZSweepMapper) const float *pixel(int x, int y) const
    {
        return RealRGBAImage + 4 * (y * ImageInUseSize[0] + x);
    }
};
vtkStandardNewMacro(zsweep_mapper)

    /* A mapper with its input, and the objects that read its pictures. */
    struct peer {
    const bench_vtk_request &request;
    vtkNew<vtkRenderWindow> window;
    vtkNew<vtkRenderer> renderer;
    vtkNew<vtkVolume> volume;
    vtkSmartPointer<vtkAbstractVolumeMapper> mapper;
    vtkSmartPointer<vtkUnstructuredGridVolumeRayIntegrator> integrator;
    vtkSmartPointer<vtkUnstructuredGrid> tets;
};

double read_seconds()
{
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/* Converts a grid to tets, because the ray caster and projected tetrahedra support no other cells. */
vtkSmartPointer<vtkUnstructuredGrid> convert_to_tets(vtkUnstructuredGrid *grid)
{
    if (grid->IsHomogeneous() && grid->GetNumberOfCells() > 0 && grid->GetCellType(0) == VTK_TETRA) return grid;
    vtkNew<vtkDataSetTriangleFilter> filter;
    filter->SetInputData(grid);
    filter->TetrahedraOnlyOn();
    filter->Update();
    return filter->GetOutput();
}

void set_ray_cast(peer &p, vtkUnstructuredGrid *grid)
{
    auto mapper = vtkSmartPointer<vtkUnstructuredGridVolumeRayCastMapper>::New();
    if (p.request.mapper == BENCH_VTK_RAY_LINEAR)
        p.integrator = vtkSmartPointer<vtkUnstructuredGridLinearRayIntegrator>::New();
    else
        p.integrator = vtkSmartPointer<vtkUnstructuredGridPartialPreIntegration>::New();
    p.tets = convert_to_tets(grid);
    mapper->SetInputData(p.tets);
    mapper->SetRayIntegrator(p.integrator);
    mapper->AutoAdjustSampleDistancesOff();
    mapper->IntermixIntersectingGeometryOff();
    p.mapper = mapper;
}

void set_zsweep(peer &p, vtkUnstructuredGrid *grid)
{
    auto mapper = vtkSmartPointer<zsweep_mapper>::New();
    p.integrator = vtkSmartPointer<vtkUnstructuredGridPartialPreIntegration>::New();
    mapper->SetInputData(grid);
    mapper->SetRayIntegrator(p.integrator);
    mapper->AutoAdjustSampleDistancesOff();
    mapper->IntermixIntersectingGeometryOff();
    p.mapper = mapper;
}

void set_projected(peer &p, vtkUnstructuredGrid *grid)
{
    auto mapper = vtkSmartPointer<vtkProjectedTetrahedraMapper>::New();
    p.tets = convert_to_tets(grid);
    mapper->SetInputData(p.tets);
    p.mapper = mapper;
}

/* Sets points outside the mesh to the value of the lowest knot. The opacity is 0 at this value. */
void clear_outside(vtkImageData *image, const char *mask_name, double value)
{
    vtkDataArray *values = image->GetPointData()->GetArray("f"), *mask = image->GetPointData()->GetArray(mask_name);
    for (vtkIdType i = 0; i < values->GetNumberOfTuples(); i++)
        if (mask->GetTuple1(i) == 0) values->SetTuple1(i, value);
    image->GetPointData()->SetActiveScalars("f");
}

void set_resample(peer &p, vtkUnstructuredGrid *grid)
{
    vtkNew<vtkResampleToImage> sampler;
    const double *bounds = grid->GetBounds();
    double longest = 0;
    int dimensions[3];
    for (int axis = 0; axis < 3; axis++) longest = std::fmax(longest, bounds[2 * axis + 1] - bounds[2 * axis]);
    for (int axis = 0; axis < 3; axis++)
        dimensions[axis] = 1 + static_cast<int>(std::ceil((p.request.resolution - 1) *
                                                          (bounds[2 * axis + 1] - bounds[2 * axis]) / longest));
    sampler->SetInputDataObject(grid);
    sampler->SetSamplingDimensions(dimensions);
    sampler->Update();
    vtkImageData *image = sampler->GetOutput();
    clear_outside(image, sampler->GetMaskArrayName(), p.request.knots[0]);
    auto mapper = vtkSmartPointer<vtkFixedPointVolumeRayCastMapper>::New();
    image->GetPointData()->RemoveArray("vtkGhostType"); /* so that blanked points are drawn too; they are transparent */
    image->GetCellData()->Initialize();
    mapper->SetInputData(image);
    mapper->AutoAdjustSampleDistancesOff();
    mapper->IntermixIntersectingGeometryOff();
    mapper->SetImageSampleDistance(1);
    mapper->SetSampleDistance(static_cast<float>(p.request.sample_distance));
    p.mapper = mapper;
}

void set_mapper(peer &p, vtkUnstructuredGrid *grid)
{
    switch (p.request.mapper) {
    case BENCH_VTK_RAY_PARTIAL:
    case BENCH_VTK_RAY_LINEAR: set_ray_cast(p, grid); break;
    case BENCH_VTK_ZSWEEP: set_zsweep(p, grid); break;
    case BENCH_VTK_PROJECTED: set_projected(p, grid); break;
    case BENCH_VTK_RESAMPLE: set_resample(p, grid); break;
    }
    p.volume->SetMapper(p.mapper);
    p.renderer->AddVolume(p.volume);
}

void set_property(peer &p)
{
    vtkNew<vtkColorTransferFunction> colour;
    vtkNew<vtkPiecewiseFunction> opacity;
    for (int i = 0; i < p.request.knot_count; i++) {
        const float *c = p.request.colours + 3 * i;
        colour->AddRGBPoint(p.request.knots[i], static_cast<double>(c[0]), static_cast<double>(c[1]),
                            static_cast<double>(c[2]));
        opacity->AddPoint(p.request.knots[i], p.request.opacities[i]);
    }
    vtkVolumeProperty *property = p.volume->GetProperty();
    property->SetColor(colour);
    property->SetScalarOpacity(opacity);
    property->SetScalarOpacityUnitDistance(p.request.unit_distance);
    property->SetInterpolationTypeToLinear();
    property->ShadeOff();
}

/* Sets the camera. The rays of the ray caster pass through the lower left corners of pixels, those of all other mappers
 * through the centres, so the ray caster's image plane is shifted by half a pixel. */
void set_view(peer &p)
{
    vtkCamera *camera = p.renderer->GetActiveCamera();
    camera->SetPosition(p.request.eye);
    camera->SetFocalPoint(p.request.focal);
    camera->SetViewUp(p.request.up);
    camera->SetViewAngle(p.request.degrees);
    if (p.request.mapper == BENCH_VTK_RAY_PARTIAL || p.request.mapper == BENCH_VTK_RAY_LINEAR)
        camera->SetWindowCenter(1.0 / p.request.size, 1.0 / p.request.size);
    p.renderer->ResetCameraClippingRange(p.mapper->GetBounds());
}

bool open_window(peer &p)
{
    if (!std::getenv("DISPLAY")) return false;
    p.renderer->SetBackground(0, 0, 0);
    p.window->SetOffScreenRendering(1);
    p.window->SetAlphaBitPlanes(1);
    p.window->SetMultiSamples(0);
    p.window->SetSize(p.request.size, p.request.size);
    p.window->AddRenderer(p.renderer);
    p.window->Render();
    return true;
}

void render_window(peer &p)
{
    p.window->Render();
    p.window->WaitForCompletion();
}

void cast_pixel(peer &p, vtkUnstructuredGridVolumeRayCastMapper *mapper, int x, int y, float rgba[4])
{
    vtkDataArray *scalars = p.tets->GetPointData()->GetScalars();
    auto rays =
        vtkSmartPointer<vtkUnstructuredGridVolumeRayCastIterator>::Take(mapper->GetRayCastFunction()->NewIterator());
    vtkNew<vtkDoubleArray> lengths;
    vtkNew<vtkFloatArray> near, far;
    double whole[2] = {0, 1};
    rays->SetBounds(whole);
    rays->Initialize(x, y);
    while (rays->GetNextIntersections(nullptr, lengths, scalars, near, far) > 0)
        p.integrator->Integrate(lengths, near, far, rgba);
}

void read_fixed_point(peer &p, float *rgba)
{
    vtkFixedPointRayCastImage *image = vtkFixedPointVolumeRayCastMapper::SafeDownCast(p.mapper)->GetRayCastImage();
    int size[2], origin[2], stride[2];
    image->GetImageInUseSize(size);
    image->GetImageOrigin(origin);
    image->GetImageMemorySize(stride);
    for (int i = 0; i < p.request.pixel_count; i++) {
        const int x = p.request.pixels[2 * i] - origin[0],
                  y = p.request.size - 1 - p.request.pixels[2 * i + 1] - origin[1];
        if (x < 0 || y < 0 || x >= size[0] || y >= size[1]) continue;
        const unsigned short *from = image->GetImage() + 4 * (y * stride[0] + x);
        for (int c = 0; c < 4; c++) rgba[4 * i + c] = static_cast<float>(from[c]) / 32767;
    }
}

void read_window(peer &p, float *rgba)
{
    vtkNew<vtkFloatArray> data;
    const int last = p.request.size - 1;
    p.window->GetRGBAPixelData(0, 0, last, last, 0, data);
    for (int i = 0; i < p.request.pixel_count; i++) {
        const vtkIdType at = (last - p.request.pixels[2 * i + 1]) * p.request.size + p.request.pixels[2 * i];
        for (int c = 0; c < 4; c++) rgba[4 * i + c] = static_cast<float>(data->GetComponent(at, c));
    }
}

void read_pixels(peer &p, float *rgba)
{
    std::fill(rgba, rgba + 4 * p.request.pixel_count, 0.0f);
    if (p.request.mapper == BENCH_VTK_RESAMPLE) return read_fixed_point(p, rgba);
    if (p.request.mapper == BENCH_VTK_PROJECTED) return read_window(p, rgba);
    for (int i = 0; i < p.request.pixel_count; i++) {
        const int x = p.request.pixels[2 * i], y = p.request.size - 1 - p.request.pixels[2 * i + 1];
        if (auto *sweep = zsweep_mapper::SafeDownCast(p.mapper))
            std::copy(sweep->pixel(x, y), sweep->pixel(x, y) + 4, rgba + 4 * i);
        else
            cast_pixel(p, vtkUnstructuredGridVolumeRayCastMapper::SafeDownCast(p.mapper), x, y, rgba + 4 * i);
    }
}

} // namespace

bool bench_vtk_draw(const bench_vtk_request *request, bench_vtk_result *result, float *rgba)
{
    vtkObject::GlobalWarningDisplayOff();
    peer p{*request, {}, {}, {}, nullptr, nullptr, nullptr};
    if (!open_window(p)) return false;
    const vtkSmartPointer<vtkUnstructuredGrid> grid = bench_vtk_make_grid(*request->mesh);
    grid->GetBounds();
    const double began = read_seconds();
    set_mapper(p, grid);
    set_property(p);
    set_view(p);
    render_window(p);
    result->first = read_seconds() - began;
    result->runs = 0;
    double total = 0;
    while (result->runs < request->runs && result->runs < BENCH_VTK_MAX_RUNS &&
           (result->runs == 0 || total < request->seconds)) {
        const double start = read_seconds();
        render_window(p);
        total += result->frames[result->runs++] = read_seconds() - start;
    }
    read_pixels(p, rgba);
    return true;
}

bool bench_vtk_is_available(void)
{
    return true;
}
