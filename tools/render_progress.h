/* Shows the progress of a run: a line per step on stdout, and on a terminal a progress bar below it on stderr. */
#ifndef RENDER_PROGRESS_H
#define RENDER_PROGRESS_H

#include <cstddef>
#include <string>

namespace render_tool
{

class progress
{
  public:
    /* Prints nothing if is_shown is false, which is the case on ranks other than 0. */
    progress(bool is_shown, size_t steps);
    ~progress();
    progress(const progress &) = delete;
    progress &operator=(const progress &) = delete;

    void begin(size_t step, const std::string &name); /* shows the step's number and name in the progress bar */
    void line(const std::string &text);               /* prints a permanent line to stdout */
    void note(const std::string &text);               /* prints a permanent line to stderr, for warnings */

  private:
    void clear();
    void draw();

    bool is_shown_;
    bool has_bar_;
    size_t steps_;
    size_t step_ = 0;
    std::string name_;
};

} // namespace render_tool

#endif
