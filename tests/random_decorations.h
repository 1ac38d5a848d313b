/* Makes random decorations of a picture: all anchors, any number of colour bars, texts from empty to long, small and
 * large sizes, and corners that are covered by other pictures. */
#ifndef TEST_RANDOM_DECORATIONS_H
#define TEST_RANDOM_DECORATIONS_H

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "insitu/image_output.h"

class random_decorations
{
  public:
    explicit random_decorations(unsigned seed) : random_(seed) {}

    /* Returns a random integer in [low, high]. */
    int draw_integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }
    double draw_real(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }

    /* Returns random decorations. They are valid until the next call. */
    const insitu_decorations &make_decorations(int width, int height)
    {
        texts_.clear();
        texts_.reserve(64);
        what_ = insitu_decorations{};
        what_.background[3] = static_cast<float>(draw_integer(0, 1));
        what_.colour[0] = 1;
        what_.size = draw_integer(0, 3) ? 0.03 : std::exp(draw_real(std::log(0.005), std::log(0.2)));
        make_words();
        make_bars();
        make_labels(width, height);
        if (draw_integer(0, 2) == 0) make_scale_bar(width);
        if (draw_integer(0, 2) == 0) make_covered(width, height);
        what_.has_axes = draw_integer(0, 1);
        for (auto &axis : what_.axes) axis[draw_integer(0, 2)] = draw_integer(0, 1) ? 1 : -1;
        return what_;
    }

  private:
    const char *make_random_text(int most)
    {
        static const char *const parts[] = {"a", "Stress", " ", "/", "MPa", "\u00b5m", "=", "1.5e-7", "\u2212", "W"};
        std::string out;
        for (int n = draw_integer(0, most); n > 0; n--) out += parts[draw_integer(0, 9)];
        texts_.push_back(out);
        return texts_.back().c_str();
    }

    void make_words()
    {
        what_.words_count = draw_integer(0, 1) ? draw_integer(0, 3) : draw_integer(0, 17);
        for (std::size_t i = 0; i < static_cast<std::size_t>(what_.words_count); i++)
            words_[i] = {make_random_text(draw_integer(0, 4) ? 8 : 60), static_cast<insitu_anchor>(draw_integer(0, 7)),
                         draw_integer(0, 3) ? 1 : 1.4F};
        what_.words = words_.data();
    }

    void make_bars()
    {
        static const float colours[] = {0, 0, 0, 1, 0, 0, 1, 1, 1};
        what_.bar_count = draw_integer(0, 1) ? draw_integer(0, 4) : draw_integer(0, 20);
        for (std::size_t i = 0; i < static_cast<std::size_t>(what_.bar_count); i++) {
            const int ticks = draw_integer(0, 12);
            for (int k = 0; k < ticks; k++) {
                insitu_tick &tick = ticks_[i][static_cast<std::size_t>(k)];
                tick.place = (k + 0.5) / ticks;
                std::snprintf(tick.text, sizeof tick.text, "%.*f", draw_integer(0, 6), draw_real(-1e4, 1e4));
            }
            bars_[i] = insitu_colour_bar{};
            bars_[i].label = make_random_text(draw_integer(0, 4) ? 6 : 60);
            bars_[i].colours = colours;
            bars_[i].colour_count = 3;
            bars_[i].is_banded = draw_integer(0, 3) == 0;
            bars_[i].below = draw_integer(0, 1) ? colours : nullptr;
            bars_[i].above = draw_integer(0, 1) ? colours : nullptr;
            bars_[i].at = draw_integer(0, 3) ? INSITU_RIGHT : INSITU_LEFT;
            bars_[i].tick_count = ticks;
            bars_[i].ticks = ticks_[i].data();
        }
        what_.bars = bars_.data();
    }

    void make_labels(int width, int height)
    {
        what_.label_count = draw_integer(0, 1) ? 0 : draw_integer(0, 39);
        for (std::size_t i = 0; i < static_cast<std::size_t>(what_.label_count); i++) {
            const double angle = draw_real(0, 6.3);
            labels_[i] = {{draw_real(-0.1, 1.1) * width, draw_real(-0.1, 1.1) * height},
                          {std::cos(angle), std::sin(angle)},
                          draw_integer(0, 3) ? 0.55 : 2.4,
                          ""};
            std::snprintf(labels_[i].text, sizeof labels_[i].text, "%.3g", draw_real(-1e4, 1e4));
        }
        what_.labels = labels_.data();
    }

    void make_scale_bar(int width)
    {
        what_.scale_bar.length = draw_real(0.05, 0.3) * width;
        what_.scale_bar.at = static_cast<insitu_anchor>(draw_integer(0, 7));
        std::snprintf(what_.scale_bar.text, sizeof what_.scale_bar.text, "%s", make_random_text(8));
    }

    /* Covers each corner with a probability of one half. The covering rectangle is close to the picture's edges, as in
     * a montage. */
    void make_covered(int width, int height)
    {
        for (int corner = 0; corner < 4; corner++) {
            if (draw_integer(0, 1)) continue;
            const int wide = draw_integer(1, std::max(1, 2 * width / 5)),
                      high = draw_integer(1, std::max(1, 2 * height / 5)), edge = draw_integer(0, height / 40);
            covered_[static_cast<std::size_t>(what_.covered_count++)] = {
                corner & 1 ? edge : width - edge - wide, corner & 2 ? edge : height - edge - high, wide, high};
        }
        what_.covered = covered_.data();
    }

    std::mt19937 random_;
    insitu_decorations what_{};
    std::vector<std::string> texts_;
    std::array<insitu_words, 17> words_{};
    std::array<insitu_colour_bar, 20> bars_{};
    std::array<std::array<insitu_tick, 12>, 20> ticks_{};
    std::array<insitu_label, 39> labels_{};
    std::array<insitu_rectangle, 4> covered_{};
};

#endif
