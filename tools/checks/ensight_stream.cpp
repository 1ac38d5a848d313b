/* A line of a text file contains one number or the numbers of one element. Binary files have lines of 80 bytes and
 * numbers of 4 bytes. Fortran stores both in records, with the length in bytes before and after the contents. */
#include "ensight_stream.h"

#include "number_check.h"

#include <array>
#include <numeric>
#include <stdexcept>
#include <vector>

namespace render_tool
{

namespace
{

constexpr std::streamsize line_bytes = 80;

std::string remove_outer_blanks(const std::string &text)
{
    const char *const blanks = " \t\r\n";
    const size_t first = text.find_first_not_of(blanks);
    return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

int32_t swapped(int32_t n)
{
    return static_cast<int32_t>(__builtin_bswap32(static_cast<uint32_t>(n)));
}

} // namespace

ensight_stream::encoding ensight_stream::detect_encoding(const std::string &path)
{
    std::ifstream in(path, std::ios::binary);
    std::array<char, 20> start{};
    in.read(start.data(), start.size());
    const std::string text(start.data(), start.size());
    if (text.find("Fortran Binary") != std::string::npos || text.find("FORTRAN BINARY") != std::string::npos)
        return encoding::fortran_binary;
    if (text.find("C Binary") != std::string::npos || text.find("C BINARY") != std::string::npos)
        return encoding::c_binary;
    return encoding::text;
}

ensight_stream::ensight_stream(const std::string &path, encoding how)
    : path_(path), in_(path, std::ios::binary | std::ios::ate), how_(how)
{
    if (!in_) fail("cannot be opened");
    size_ = static_cast<int64_t>(in_.tellg());
    in_.seekg(-1, std::ios::end);
    if (how == encoding::text && in_.get() != '\n') fail("is cut short: its last line has no end");
    in_.clear();
    in_.seekg(0);
}

void ensight_stream::fail(const std::string &why) const
{
    throw std::runtime_error(path_ + ": " + why);
}

bool ensight_stream::next_line(std::string &line)
{
    if (how_ == encoding::text) {
        while (std::getline(in_, line)) {
            line = remove_outer_blanks(line);
            if (!line.empty()) return true;
        }
        return false;
    }
    if (in_.peek() == std::char_traits<char>::eof()) return false;
    begin_record();
    std::array<char, line_bytes + 1> bytes{};
    if (!in_.read(bytes.data(), line_bytes)) fail("is cut short: it ends within a line");
    line = remove_outer_blanks(bytes.data());
    end_record();
    return true;
}

std::string ensight_stream::line()
{
    std::string text;
    if (!next_line(text)) fail("is cut short");
    return text;
}

/* Reads an integer that must be small and not negative, such as a part number or a count. Larger values mean that the
 * byte order is wrong. */
int32_t ensight_stream::binary_integer()
{
    int32_t n = 0;
    if (!in_.read(reinterpret_cast<char *>(&n), sizeof n)) fail("is cut short");
    if (!knows_order_) is_swapped_ = static_cast<uint32_t>(swapped(n)) < static_cast<uint32_t>(n);
    knows_order_ = true;
    return is_swapped_ ? swapped(n) : n;
}

void ensight_stream::begin_record()
{
    if (how_ == encoding::fortran_binary) binary_integer();
}

void ensight_stream::check_count(int64_t count) const
{
    if (count < 0) fail("has a negative number of values");
    if (count > size_)
        fail("is cut short: it says it has " + std::to_string(count) + " values in " + std::to_string(size_) +
             " bytes");
}

void ensight_stream::integers(int64_t *values, int64_t count)
{
    check_count(count);
    begin_record();
    for (int64_t i = 0; i < count; i++) {
        if (how_ != encoding::text)
            values[i] = binary_integer();
        else if (!(in_ >> values[i]))
            fail("is cut short: a whole number is missing");
        if (values[i] < 0) fail("has a negative number of values");
    }
    end_record();
}

int64_t ensight_stream::integer()
{
    int64_t value = 0;
    integers(&value, 1);
    return value;
}

int64_t ensight_stream::sum_of_integers(int64_t count)
{
    check_count(count);
    std::vector<int64_t> values(static_cast<size_t>(count));
    integers(values.data(), count);
    return std::accumulate(values.begin(), values.end(), int64_t{0});
}

void ensight_stream::skip_numbers(int64_t count)
{
    check_count(count);
    if (how_ != encoding::text) {
        begin_record();
        if (count * 4 > size_ - static_cast<int64_t>(in_.tellg())) fail("is cut short");
        in_.seekg(count * 4, std::ios::cur);
        end_record();
        return;
    }
    std::string value;
    for (int64_t i = 0; i < count; i++) {
        if (!(in_ >> value)) fail("is cut short: a number is missing");
        if (!is_number(value))
            refuse_number(path_, value, in_.eof() ? size_ - 1 : static_cast<int64_t>(in_.tellg()) - 1);
    }
}

} // namespace render_tool
