/* The medium of the wave, and its source. The unit of length is half of the box's longest side; the slowest layer has
 * the speed 0.8. */
#ifndef WAVE_MEDIUM_H
#define WAVE_MEDIUM_H

#include <stdint.h>

#include "wave_lattice.h"

enum { WAVE_LAYERS_MAX = 8 };

/* Horizontal layers, from the surface down. */
typedef struct wave_medium {
    int count;
    double bottom[WAVE_LAYERS_MAX]; /* z of each layer's lower side, descending; the last layer extends to the bottom of
                                       the box */
    double speed[WAVE_LAYERS_MAX];
    double density[WAVE_LAYERS_MAX];
} wave_medium;

/* A source that injects volume at the rate Q(t) = strength amplitude tau exp(-(pi frequency tau)^2) with tau = t -
 * delay, repeated with the period. It is distributed in space by a Gaussian function with the standard deviation
 * `radius`. Far away the pressure is density / (4 pi r) Q'(t - r / speed), a Ricker wavelet. The total injected volume
 * is zero, because Q is an odd function of tau. */
typedef struct wave_source {
    double position[3];
    double frequency;
    double delay;
    double amplitude;
    double strength; /* factor of the injection rate; 1 by default */
    double period;   /* period of the pulses; 0 for a single pulse. A complete pulse takes twice the delay */
    double radius;   /* standard deviation of the Gaussian ball */
} wave_source;

/* Returns four layers. Their stiffness and density increase with depth. */
wave_medium wave_medium_make_layered(const wave_lattice *lattice);

uint8_t wave_medium_layer(const wave_medium *medium, double z);

/* Returns a source in the third layer, away from the centre. Its pressure has the amplitude 1 at a distance of 0.5. */
wave_source wave_source_make_default(const wave_lattice *lattice, const wave_medium *medium);

double wave_source_rate(const wave_source *source, double time);

/* Returns the fraction of the source's injection rate that is injected per unit volume at this position; 0 farther than
 * five radii from the source. */
double wave_source_density(const wave_source *source, const double xyz[3]);

#endif
