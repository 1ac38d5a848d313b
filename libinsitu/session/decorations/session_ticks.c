#include "session_ticks.h"
#include "text_file.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* A round distance between ticks: `factor` (1, 2 or 5) times 10^exponent. */
typedef struct round_step {
    int factor, exponent;
} round_step;

static double compute_size_of_round_step(round_step step)
{
    return step.factor * pow(10, step.exponent);
}

static round_step get_next_larger_round_step(round_step step)
{
    if (step.factor == 5) return (round_step){1, step.exponent + 1};
    return (round_step){step.factor == 1 ? 2 : 5, step.exponent};
}

/* Computes the integers `first` and `last` such that first * step and last * step are the smallest and the largest
 * multiple of the step in [low, high]. A multiple that differs from low or high only by rounding is included. */
static void find_range_of_multiples(double low, double high, double step, double *first, double *last)
{
    const double slack = 1e-9 * (high - low) / step;
    *first = ceil(low / step - slack);
    *last = floor(high / step + slack);
}

static round_step choose_round_step(double low, double high, int most)
{
    round_step step = {1, (int)floor(log10((high - low) / most))};
    double first, last;
    find_range_of_multiples(low, high, compute_size_of_round_step(step), &first, &last);
    while (last - first >= most) {
        step = get_next_larger_round_step(step);
        find_range_of_multiples(low, high, compute_size_of_round_step(step), &first, &last);
    }
    return step;
}

/* Removes leading zeros of the exponent: "1.20e+05" becomes "1.20e5". Zeros of the mantissa are kept, since "1.2e5"
 * would have fewer digits than the neighbouring ticks. */
static void shorten_exponent(char *text)
{
    char *e = strchr(text, 'e');
    if (!e) return;
    const bool is_negative = e[1] == '-';
    const size_t zeros = strspn(e + 2, "0");
    const char *digits = e + 2 + (e[2 + zeros] ? zeros : zeros - 1); /* keeps one digit of the exponent e+00 */
    memmove(e + 1 + is_negative, digits, strlen(digits) + 1);
}

/* Writes a number with `digits` digits after the decimal point, with an exponent unless is_plain is set. */
static void write_number(double value, bool is_plain, int digits, char *text, size_t size)
{
    const int shown = digits < 0 ? 0 : digits > 15 ? 15 : digits;
    if (value == 0)
        snprintf(text, size, "0");
    else if (is_plain)
        snprintf(text, size, "%.*f", shown, value);
    else
        snprintf(text, size, "%.*e", shown, value);
    if (!is_plain) shorten_exponent(text);
}

/* Writes the number in the form that the scene requests. If it requests none, the number is written with `digits`
 * digits after the decimal point, and with an exponent unless is_plain is set. */
static void write_number_in_form(double value, const scene_number_form *form, bool is_plain, int digits,
                                 insitu_tick *tick)
{
    enum { MOST = sizeof tick->text - 2 };
    const int wanted = form->has_digits ? form->digits : digits;
    const double size = fabs(value);
    if (form->notation == SCENE_SCIENTIFIC) is_plain = false;
    if (form->notation == SCENE_FIXED) is_plain = !(size >= 1) || log10(size) + 2 + wanted < MOST;
    write_number(value, is_plain, wanted, tick->text, sizeof tick->text);
}

static double compute_position_on_scale(const session_scale *s, double value)
{
    const double low = render_scaled(s->kind, s->threshold, s->low);
    const double high = render_scaled(s->kind, s->threshold, s->high);
    return fmin(fmax((render_scaled(s->kind, s->threshold, value) - low) / (high - low), 0), 1);
}

/* ---- ticks on a linear scale --------------------------------------------------------------------------------- */

static int fill_ticks_at_multiples(const session_scale *s, int most, insitu_tick *ticks)
{
    const round_step step = choose_round_step(s->low, s->high, most);
    const double largest = fmax(fabs(s->low), fabs(s->high));
    const bool is_short = largest < 1e6 && largest >= 1e-3 && step.exponent > -9;
    const scene_notation notation = s->number_form.notation;
    const bool is_plain = notation == SCENE_SHORTEST ? is_short : notation == SCENE_FIXED;
    const int digits = is_plain ? -step.exponent : (int)floor(log10(largest)) - step.exponent;
    double first, last;
    int count = 0;
    find_range_of_multiples(s->low, s->high, compute_size_of_round_step(step), &first, &last);
    for (double n = first; n <= last && count < SESSION_MAX_TICKS; n++) {
        const double value = n * compute_size_of_round_step(step);
        ticks[count].place = compute_position_on_scale(s, value);
        write_number_in_form(value, &s->number_form, is_plain, digits, &ticks[count]);
        count++;
    }
    return count;
}

/* ---- ticks on a logarithmic scale ---------------------------------------------------------------------------- */

/* The choice of values that get a tick on a logarithmic scale. These are powers of ten whose exponents are multiples of
 * `step`, and also 2 and 5 times these powers if has_2_and_5 is set. */
typedef struct decade_choice {
    bool has_2_and_5;
    int step;
} decade_choice;

static void add_tick_if_in_range(const session_scale *s, double value, insitu_tick *ticks, int *count)
{
    const double size = fabs(value), slack = 1e-9 * size;
    if (value < s->low - slack || value > s->high + slack) return;
    if (*count < SESSION_MAX_TICKS) {
        insitu_tick *tick = &ticks[*count];
        const bool is_short = size < 1e4 && size > 9e-4;
        const bool is_plain =
            s->number_form.notation == SCENE_SHORTEST ? is_short : s->number_form.notation == SCENE_FIXED;
        tick->place = compute_position_on_scale(s, value);
        write_number_in_form(value, &s->number_form, is_plain,
                             is_plain && size < 0.9999 ? (int)ceil(-log10(size) - 1e-9) : 0, tick);
    }
    (*count)++;
}

/* Adds ticks at the powers of ten in the range, multiplied by `sign`, and at 2 and 5 times these powers if the choice
 * includes them. */
static void add_ticks_at_powers_of_ten(const session_scale *s, double sign, decade_choice choice, insitu_tick *ticks,
                                       int *count)
{
    const double largest = fmax(fabs(s->low), fabs(s->high));
    const double smallest = s->kind == RENDER_SYMLOG ? s->threshold : s->low;
    const int last = (int)floor(log10(largest) + 1e-9), first = (int)floor(log10(smallest) + 1e-9);
    for (int n = first; n <= last; n++) {
        if (n % choice.step) continue;
        const double power = pow(10, n);
        if (power >= smallest * (1 - 1e-9)) add_tick_if_in_range(s, sign * power, ticks, count);
        if (choice.has_2_and_5 && 2 * power >= smallest) add_tick_if_in_range(s, sign * 2 * power, ticks, count);
        if (choice.has_2_and_5 && 5 * power >= smallest) add_tick_if_in_range(s, sign * 5 * power, ticks, count);
    }
}

static int make_logarithmic_ticks(const session_scale *s, decade_choice choice, insitu_tick *ticks)
{
    int count = 0;
    if (s->kind == RENDER_SYMLOG) {
        add_ticks_at_powers_of_ten(s, -1, choice, ticks, &count);
        add_tick_if_in_range(s, 0, ticks, &count);
    }
    add_ticks_at_powers_of_ten(s, 1, choice, ticks, &count);
    return count;
}

/* ---- ticks on any scale ---------------------------------------------------------------------------------------- */

static int make_ticks_for_scale(const session_scale *s, int most, insitu_tick *ticks)
{
    if (s->kind == RENDER_LINEAR) return fill_ticks_at_multiples(s, most, ticks);
    int count = make_logarithmic_ticks(s, (decade_choice){true, 1}, ticks);
    for (int every = 1; count > most && every <= 64; every++)
        count = make_logarithmic_ticks(s, (decade_choice){false, every}, ticks);
    return count < 2 ? fill_ticks_at_multiples(s, most, ticks) : count;
}

/* Adds a tick in the centre of each band (one of `bands` intervals of equal width), or of every n-th band if there are
 * many. Does this only if each band corresponds to one integer: the range begins and ends at integers, or half a band
 * beyond them. Returns the number of ticks; 0 if the bands do not correspond to integers. */
static int add_ticks_at_integer_bands(const session_scale *s, int bands, insitu_tick *ticks)
{
    const double half = s->high - s->low == bands ? 0.5 : 0, first = s->low + half, largest = 1e9;
    const int every = (bands + SESSION_MAX_TICKS - 1) / SESSION_MAX_TICKS;
    int count = 0;
    if (s->kind != RENDER_LINEAR || s->high - s->low + 1 != bands + 2 * half) return 0;
    if (first != floor(first) || fabs(first) > largest) return 0;
    for (int band = 0; band < bands; band += every) {
        ticks[count].place = (band + 0.5) / bands;
        write_number(first + band, true, 0, ticks[count].text, sizeof ticks[count].text);
        count++;
    }
    return count;
}

int session_make_ticks_for_colour_bands(const session_scale *scale, int bands, int most,
                                        insitu_tick ticks[SESSION_MAX_TICKS])
{
    const int count = add_ticks_at_integer_bands(scale, bands, ticks);
    return count ? count : session_make_ticks(scale, most, ticks);
}

int session_make_ticks(const session_scale *scale, int most, insitu_tick ticks[SESSION_MAX_TICKS])
{
    c_locale numbers;
    const bool is_begun = c_locale_enter(&numbers);
    const int count = make_ticks_for_scale(scale, most, ticks);
    if (is_begun) c_locale_leave(&numbers);
    return count;
}

int session_make_constant_tick(double value, const scene_number_form *form, insitu_tick *tick)
{
    c_locale numbers;
    const bool is_begun = c_locale_enter(&numbers);
    tick->place = 0.5;
    if (form->has_digits || form->notation != SCENE_SHORTEST) {
        write_number_in_form(value, form, fabs(value) < 1e6, 6, tick);
    } else {
        snprintf(tick->text, sizeof tick->text, "%.9g", value);
        shorten_exponent(tick->text);
    }
    if (is_begun) c_locale_leave(&numbers);
    return 1;
}
