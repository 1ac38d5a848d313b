/* Reads the header by the specification of the format. All numbers are big-endian; N has 4 bytes, or 8 in CDF-5:
 *
 *     "CDF" version  records:N  dimensions  attributes  variables
 *     list           = tag:4 count:N entries
 *     dimension      = name length:N                       length 0: the record dimension
 *     attribute      = name type:4 count:N values, padded to 4 bytes
 *     variable       = name rank:N dimension:N... attributes type:4 size:N begin:4 (CDF-1) or 8
 *     name           = length:N characters, padded to 4 bytes
 *
 * A variable that has the record dimension consists of one slab per record; the slabs of all such variables
 * alternate. */
#include "netcdf_size.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <vector>

namespace render_tool
{

namespace
{

class header
{
  public:
    explicit header(const std::string &path) : in_(path, std::ios::binary)
    {
        std::array<char, 4> magic{};
        in_.read(magic.data(), 4);
        version_ = in_ && magic[0] == 'C' && magic[1] == 'D' && magic[2] == 'F' ? magic[3] : 0;
    }

    bool is_classic() const { return version_ == 1 || version_ == 2 || version_ == 5; }

    /* Returns the length of the file, or 0 if the header is truncated. */
    int64_t file_bytes()
    {
        records_ = count();
        for (int64_t i = list(); i > 0 && in_; i--) {
            skip_name();
            dimensions_.push_back(count());
        }
        skip_attributes();
        for (int64_t i = list(); i > 0 && in_; i--) add_variable();
        if (!in_) return 0;
        const bool has_records = record_end_ > 0 && records_ > 0 && records_ != streaming_;
        return std::max(fixed_end_, has_records ? record_end_ + (records_ - 1) * record_bytes_ : 0);
    }

  private:
    int64_t number(int bytes)
    {
        int64_t n = 0;
        for (int i = 0; i < bytes; i++) n = (n << 8) | (in_.get() & 0xff);
        return in_ ? n : 0;
    }
    int64_t count() { return number(version_ == 5 ? 8 : 4); }
    int64_t list()
    {
        number(4);
        return count();
    }
    void skip(int64_t bytes) { in_.seekg((bytes + 3) / 4 * 4, std::ios::cur); }
    void skip_name() { skip(count()); }
    static int64_t bytes_of_type(int64_t type)
    {
        static const std::array<int64_t, 12> bytes = {0, 1, 1, 2, 4, 4, 8, 1, 2, 4, 8, 8};
        return type > 0 && type < 12 ? bytes[static_cast<size_t>(type)] : 0;
    }
    void skip_attributes()
    {
        for (int64_t i = list(); i > 0 && in_; i--) {
            skip_name();
            const int64_t element = bytes_of_type(number(4));
            skip(count() * element);
        }
    }
    void add_variable()
    {
        skip_name();
        int64_t elements = 1;
        bool has_records = false;
        const int64_t rank = count();
        for (int64_t d = 0; d < rank && in_; d++) {
            const auto id = static_cast<size_t>(count());
            const int64_t length = id < dimensions_.size() ? dimensions_[id] : 1;
            has_records = has_records || length == 0;
            elements *= std::max<int64_t>(length, 1);
        }
        skip_attributes();
        const int64_t bytes = elements * bytes_of_type(number(4));
        count(); /* skips the size in the header, which is wrong above 4 GB */
        const int64_t begin = number(version_ == 1 ? 4 : 8);
        int64_t &end = has_records ? record_end_ : fixed_end_;
        end = std::max(end, begin + bytes);
        if (has_records) record_bytes_ += (bytes + 3) / 4 * 4;
    }

    static constexpr int64_t streaming_ =
        0xffffffff; // number of records in the header of a file whose writer did not count them
    std::ifstream in_;
    int version_ = 0;
    int64_t records_ = 0;
    std::vector<int64_t> dimensions_;
    int64_t fixed_end_ = 0;    // position in the file at which the last variable without records ends
    int64_t record_end_ = 0;   // position in the file at which the first record ends; 0 if there are no records
    int64_t record_bytes_ = 0; // size in bytes of one record of all variables
};

} // namespace

int64_t netcdf_bytes(const std::string &path)
{
    header h(path);
    return h.is_classic() ? h.file_bytes() : 0;
}

} // namespace render_tool
