/* Shows how far a run is: a line a step on stdout, and on a terminal a bar below it on stderr. */
#ifndef RENDER_PROGRESS_H
#define RENDER_PROGRESS_H

#include <cstddef>
#include <string>

namespace render_tool
{

class progress
{
  public:
    /* Silent where is_shown is false: ranks other than 0. */
    progress(bool is_shown, size_t steps);
    ~progress();
    progress(const progress &) = delete;
    progress &operator=(const progress &) = delete;

    void begin(size_t step, const std::string &name); /* the bar says what is at work */
    void line(const std::string &text);               /* a line that stays */
    void note(const std::string &text);               /* the same on stderr: warnings */

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
