/* The medium that the wave goes through, and its source. Lengths are in half box sides; the slowest layer has speed
 * 0.8. */
#ifndef WAVE_MEDIUM_H
#define WAVE_MEDIUM_H

#include <stdint.h>

#include "wave_lattice.h"

enum { WAVE_LAYERS_MAX = 8 };

/* Flat layers, from the surface down. */
typedef struct wave_medium {
    int count;
    double bottom[WAVE_LAYERS_MAX]; /* z of each layer's lower side, falling; the last reaches all the way down */
    double speed[WAVE_LAYERS_MAX];
    double density[WAVE_LAYERS_MAX];
} wave_medium;

/* A point that injects volume at the rate Q(t) = strength amplitude tau exp(-(pi frequency tau)^2), tau = t - delay,
 * again and again each period, smeared over a Gaussian ball of this radius. Far away the pressure is density / (4 pi r)
 * Q'(t - r / speed): Ricker's wavelet. Over all time nothing is added: Q is odd about its delay. */
typedef struct wave_source {
    double position[3];
    double frequency;
    double delay;
    double amplitude;
    double strength; /* 1 by default */
    double period;   /* 0: one pulse; a whole pulse takes twice the delay */
    double radius;   /* standard deviation of the ball */
} wave_source;

/* Four layers, stiffer and heavier with depth. */
wave_medium wave_medium_layered(const wave_lattice *lattice);

uint8_t wave_medium_layer(const wave_medium *medium, double z);

/* A source in the third layer, off the middle, whose pressure is 1 at a distance of 0.5. */
wave_source wave_source_default(const wave_lattice *lattice, const wave_medium *medium);

double wave_source_rate(const wave_source *source, double time);

/* Share of the rate per unit volume at this place; 0 further than five radii away. */
double wave_source_density(const wave_source *source, const double xyz[3]);

#endif
