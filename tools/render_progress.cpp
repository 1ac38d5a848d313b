/* The bar is redrawn in place with a carriage return. It is cleared before every permanent line, and at the end. */
#include "render_progress.h"

#include <cstdio>

#include <unistd.h>

namespace render_tool
{

namespace
{
constexpr size_t bar_width = 30;
}

progress::progress(bool is_shown, size_t steps)
    : is_shown_(is_shown), has_bar_(is_shown && isatty(STDERR_FILENO)), steps_(steps)
{
}

progress::~progress()
{
    clear();
}

void progress::clear()
{
    if (has_bar_) std::fputs("\r\033[K", stderr);
}

void progress::draw()
{
    if (!has_bar_ || steps_ == 0) return;
    const size_t filled = bar_width * step_ / steps_;
    const std::string bar = std::string(filled, '#') + std::string(bar_width - filled, '-');
    std::fprintf(stderr, "\r\033[K[%s] %zu/%zu %s", bar.c_str(), step_ + 1, steps_, name_.c_str());
    std::fflush(stderr);
}

void progress::begin(size_t step, const std::string &name)
{
    step_ = step;
    name_ = name;
    draw();
}

void progress::line(const std::string &text)
{
    if (!is_shown_) return;
    clear();
    std::printf("%s\n", text.c_str());
    std::fflush(stdout);
    draw();
}

void progress::note(const std::string &text)
{
    if (!is_shown_) return;
    clear();
    std::fprintf(stderr, "insitu-render: %s\n", text.c_str());
    draw();
}

} // namespace render_tool
