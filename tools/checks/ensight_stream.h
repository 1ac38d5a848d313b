/* The lines and numbers of an EnSight Gold file in any of its three encodings. */
#ifndef ENSIGHT_STREAM_H
#define ENSIGHT_STREAM_H

#include <cstdint>
#include <fstream>
#include <string>

namespace render_tool
{

/* Every function throws std::runtime_error with the file's name where the file ends too early. */
class ensight_stream
{
  public:
    /* The case's geometry files tell the encoding by their first bytes. */
    enum class encoding { text, c_binary, fortran_binary };

    static encoding encoding_of(const std::string &path);
    ensight_stream(const std::string &path, encoding how);

    /* The next line, without blanks around it; in text the next one that is not blank. False at the end of the file. */
    bool next_line(std::string &line);
    std::string line();

    int64_t integer();
    void integers(int64_t *values, int64_t count); /* in one record, none negative */
    int64_t sum_of_integers(int64_t count);        /* in one record */
    void skip_numbers(int64_t count);              /* skips numbers of 4 bytes in one record */

    [[noreturn]] void refuse(const std::string &why) const;

  private:
    int32_t binary_integer();
    void begin_record();
    void end_record() { begin_record(); }
    void check_count(int64_t count) const;

    std::string path_;
    std::ifstream in_;
    encoding how_;
    int64_t size_ = 0;
    bool is_swapped_ = false, knows_order_ = false;
};

} // namespace render_tool

#endif
