/* Checks the deep file of a run: after OpenImageIO has flattened it, as `oiiotool --flatten` does, it must equal the
 * flat file of the same run. The scenes have transparent isosurfaces and a volume; files are written in the background,
 * on any number of ranks. */
#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <insitu/insitu.h>

#include <cmath>
#include <csetjmp>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

extern "C" {
#include <cmocka.h>
}

namespace
{

std::string folder; /* output folder; each number of ranks has its own */
int own_rank, rank_count;

/* Size in cells of a rank's slab of hexes. The slabs of the ranks are side by side along x. */
enum { NX = 3, NY = 10, NZ = 10 };

struct slab {
    std::vector<double> places, values;
    std::vector<std::int32_t> hexes;
};

std::int32_t get_slab_vertex_index(int i, int j, int k)
{
    return i + (NX + 1) * (j + (NY + 1) * k);
}

slab make_slab()
{
    slab s;
    const double width = 10.0 / (NX * rank_count);
    for (int k = 0; k <= NZ; k++)
        for (int j = 0; j <= NY; j++)
            for (int i = 0; i <= NX; i++) {
                const double x = width * (i + own_rank * NX);
                s.places.insert(s.places.end(), {x, static_cast<double>(j), static_cast<double>(k)});
                s.values.push_back(std::cos(std::hypot(x - 5, j - 5.0, k - 5.0)));
            }
    for (int c = 0; c < NX * NY * NZ; c++)
        for (int n = 0; n < 8; n++)
            s.hexes.push_back(get_slab_vertex_index(c % NX + (n % 4 == 1 || n % 4 == 2), c / NX % NY + n % 4 / 2,
                                                    c / NX / NY + n / 4));
    return s;
}

void submit_slab(insitu_session *session, const slab &s)
{
    insitu_mesh mesh;
    insitu_field field;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = static_cast<std::int64_t>(s.values.size());
    insitu_mesh_interleaved(&mesh, s.places.data(), INSITU_FLOAT64);
    mesh.cell_count = NX * NY * NZ;
    mesh.cell_type = INSITU_HEX;
    mesh.connectivity_count = static_cast<std::int64_t>(s.hexes.size());
    mesh.connectivity = {s.hexes.data(), INSITU_INT32, 0};
    insitu_field_defaults(&field);
    field.name = "f";
    field.count = mesh.vertex_count;
    field.values = {s.values.data(), INSITU_FLOAT64, 0};
    assert_int_equal(insitu_set_mesh(session, "slab", &mesh), INSITU_OK);
    assert_int_equal(insitu_set_field(session, "slab", &field), INSITU_OK);
}

/* Draws one picture into a flat and a deep file. Each picture needs its own file names, because OpenImageIO caches
 * files that it has read. */
void draw_picture(const std::string &name, const std::string &layers)
{
    const std::string scene = folder + "/scene.yaml";
    if (own_rank == 0)
        std::ofstream(scene) << "images:\n  - name: a\n    size: [97, 61]\n    background: [0, 0, 0, 0]\n    layers:\n"
                             << layers << "    outputs: [{path: " << folder << "/" << name << ".exr}, {path: " << folder
                             << "/" << name << "_deep.exr, deep: true}]\n";
    const slab s = make_slab();
    insitu_session *session = nullptr;
    assert_int_equal(insitu_create(MPI_COMM_WORLD, scene.c_str(), &session), INSITU_OK);
    submit_slab(session, s);
    assert_int_equal(insitu_step(session, 0, 0), INSITU_OK);
    assert_int_equal(insitu_destroy(&session), INSITU_OK);
}

/* Compares the flattened deep file with the flat file. The tolerance is a number of roundings by 2^-24 of values of at
 * most 1: for each sample three in compositing, one in A, and three in OpenImageIO. */
void compare_flattened_file(const std::string &name)
{
    if (own_rank != 0) return;
    const OIIO::ImageBuf deep(folder + "/" + name + "_deep.exr"), picture(folder + "/" + name + ".exr");
    const OIIO::ImageBuf flattened = OIIO::ImageBufAlgo::flatten(deep);
    if (flattened.has_error()) fail_msg("%s", flattened.geterror().c_str());
    double worst = 0;
    int most = 0;
    for (int y = 0; y < 61; y++)
        for (int x = 0; x < 97; x++) {
            float flat[5], own[6];
            picture.getpixel(x, y, flat, 5);
            flattened.getpixel(x, y, own, 6);
            const int samples = deep.deep_samples(x, y, 0);
            most = samples > most ? samples : most;
            for (std::size_t c = 0; c < 4; c++) {
                const double off = std::fabs(static_cast<double>(flat[c]) - static_cast<double>(own[c]));
                worst = off > worst ? off : worst;
                assert_true(off <= std::ldexp(7.0, -24) * samples);
            }
        }
    std::printf("%s: %d samples in a pixel at most, off by %.2g\n", name.c_str(), most, worst);
    assert_true(most > 1);
}

void flattened_deep_surfaces_match_the_flat_picture(void **)
{
    draw_picture("surfaces", "      - isosurface: {field: f, values: [-0.5, 0, 0.5], opacity: 0.3}\n");
    compare_flattened_file("surfaces");
}

void flattened_deep_volume_matches_the_flat_picture(void **)
{
    draw_picture("volume",
                 "      - volume: {field: f}\n      - isosurface: {field: f, values: [-0.5, 0.5], opacity: 0.3}\n");
    compare_flattened_file("volume");
}

} // namespace

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &own_rank);
    MPI_Comm_size(MPI_COMM_WORLD, &rank_count);
    folder = std::string(argc > 1 ? argv[1] : ".") + "/deep_np" + std::to_string(rank_count);
    if (own_rank == 0) std::filesystem::create_directories(folder);
    MPI_Barrier(MPI_COMM_WORLD);
    const CMUnitTest tests[] = {
        cmocka_unit_test(flattened_deep_surfaces_match_the_flat_picture),
        cmocka_unit_test(flattened_deep_volume_matches_the_flat_picture),
    };
    const int failures = cmocka_run_group_tests(tests, nullptr, nullptr);
    MPI_Finalize();
    return failures;
}
