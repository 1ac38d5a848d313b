/* Reads the lines and numbers of an EnSight Gold file in any of its three encodings. */
#ifndef ENSIGHT_STREAM_H
#define ENSIGHT_STREAM_H

#include <cstdint>
#include <fstream>
#include <string>

namespace render_tool
{

/* A file of the case. Every member throws std::runtime_error with the file's name if the file ends too early. */
class ensight_stream
{
  public:
    /* The encoding of all files of a case. It is recognized by the first bytes of the geometry files. */
    enum class encoding { text, c_binary, fortran_binary };

    static encoding detect_encoding(const std::string &path);
    ensight_stream(const std::string &path, encoding how);

    /* Reads the next line, without leading and trailing blanks; in text files blank lines are skipped. Returns false at
     * the end of the file. */
    bool next_line(std::string &line);
    std::string line();

    int64_t integer();
    void integers(int64_t *values, int64_t count); /* reads one record of integers, which must not be negative */
    int64_t sum_of_integers(int64_t count);        /* reads one record and returns the sum of its integers */
    void skip_numbers(int64_t count);              /* skips one record of 4-byte numbers */

    [[noreturn]] void fail(const std::string &why) const;

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
