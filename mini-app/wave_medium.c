/* A small earthquake: the source is below slower and lighter layers, so that the wave is refracted towards the surface
 * and partially reflected at each interface. */
#include "wave_medium.h"

#include <math.h>

static const double pi = 3.14159265358979323846;

wave_medium wave_medium_make_layered(const wave_lattice *lattice)
{
    static const double share[] = {0.18, 0.4, 0.7, 1.0};
    static const double speed[] = {0.8, 1.1, 1.5, 2.0};
    static const double density[] = {1.0, 1.2, 1.4, 1.6};
    wave_medium medium = {.count = 4};
    for (int l = 0; l < medium.count; ++l) {
        medium.bottom[l] = share[l] * lattice->origin[2];
        medium.speed[l] = speed[l];
        medium.density[l] = density[l];
    }
    return medium;
}

uint8_t wave_medium_layer(const wave_medium *medium, double z)
{
    int layer = 0;
    while (layer < medium->count - 1 && z < medium->bottom[layer]) ++layer;
    return (uint8_t)layer;
}

wave_source wave_source_make_default(const wave_lattice *lattice, const wave_medium *medium)
{
    double depth = lattice->origin[2];
    wave_source source = {.position = {0.2 * lattice->origin[0], 0.1 * lattice->origin[1], 0.52 * depth},
                          .frequency = 2.5,
                          .delay = 0.36,
                          .strength = 1};
    int layer = wave_medium_layer(medium, source.position[2]);
    source.amplitude = 4 * pi * 0.5 / medium->density[layer];
    /* The radius is a ninth of a wavelength, but at least the edge of a cube, so that the ball contains cell
     * centroids. */
    source.radius = fmax(medium->speed[layer] / source.frequency / 9, lattice->edge);
    return source;
}

double wave_source_rate(const wave_source *source, double time)
{
    double tau = (source->period > 0 ? fmod(time, source->period) : time) - source->delay;
    double a = pi * source->frequency * tau;
    return source->strength * source->amplitude * tau * exp(-a * a);
}

double wave_source_density(const wave_source *source, const double xyz[3])
{
    double s = source->radius, d2 = 0;
    for (int a = 0; a < 3; ++a) d2 += (xyz[a] - source->position[a]) * (xyz[a] - source->position[a]);
    if (d2 > 25 * s * s) return 0;
    return exp(-d2 / (2 * s * s)) / (pow(2 * pi, 1.5) * s * s * s);
}
