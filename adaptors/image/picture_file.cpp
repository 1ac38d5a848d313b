#include "picture_file.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <dirent.h>
#include <fcntl.h>
#include <filesystem>
#include <memory>
#include <mutex>
#include <random>
#include <set>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

namespace
{

const char name_begin[] = ".insitu-", name_end[] = ".part";
enum { random_digits = 16 };

[[noreturn]] void fail(const char *what, int code)
{
    throw io_error(what + std::string(std::strerror(code)));
}

class descriptor
{
  public:
    explicit descriptor(int number) : number_(number) {}
    descriptor(const descriptor &) = delete;
    descriptor &operator=(const descriptor &) = delete;
    ~descriptor() { close(); }
    int number() const { return number_; }
    /* Closes the file. Returns 0, or the errno of a write that failed only at this point. */
    int close()
    {
        const int number = std::exchange(number_, -1);
        return number >= 0 && ::close(number) != 0 ? errno : 0;
    }

  private:
    int number_;
};

/* ---- names ---- */

/* Returns a random name for a temporary file, short enough for every usual file system. */
std::string random_name()
{
    static std::random_device source;
    static std::mutex lock;
    const std::lock_guard<std::mutex> guard(lock);
    char digits[random_digits + 1];
    std::snprintf(digits, sizeof digits, "%08x%08x", source(), source());
    return std::string(name_begin) + digits + name_end;
}

bool is_temporary(const char *name)
{
    const std::size_t begin = sizeof name_begin - 1, size = begin + random_digits + sizeof name_end - 1;
    return std::strlen(name) == size && std::strncmp(name, name_begin, begin) == 0 &&
           std::strspn(name + begin, "0123456789abcdef") == random_digits &&
           std::strcmp(name + begin + random_digits, name_end) == 0;
}

/* ---- temporary files of killed runs ---- */

/* Removes a temporary file of this user if it is not locked. A running writer would hold a lock on it. */
void remove_if_unlocked(int folder, const char *name)
{
    const descriptor file(openat(folder, name, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    struct stat found;
    if (file.number() < 0 || fstat(file.number(), &found) != 0) return;
    if (!S_ISREG(found.st_mode) || found.st_uid != geteuid()) return;
    if (flock(file.number(), LOCK_EX | LOCK_NB) == 0) unlinkat(folder, name, 0);
}

void remove_stale_files(int folder)
{
    const int again = openat(folder, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    const std::unique_ptr<DIR, int (*)(DIR *)> entries(again < 0 ? nullptr : fdopendir(again), closedir);
    if (!entries && again >= 0) close(again);
    while (entries) {
        const dirent *entry = readdir(entries.get());
        if (!entry) return;
        if (is_temporary(entry->d_name)) remove_if_unlocked(folder, entry->d_name);
    }
}

/* Removes old temporary files of a folder, one time per process and folder, because reading a folder with many pictures
 * is slow. */
void remove_stale_files_once(int folder)
{
    static std::set<std::pair<dev_t, ino_t>> cleaned_folders;
    static std::mutex lock;
    struct stat found;
    if (fstat(folder, &found) != 0) return;
    {
        const std::lock_guard<std::mutex> guard(lock);
        if (!cleaned_folders.insert({found.st_dev, found.st_ino}).second) return;
    }
    remove_stale_files(folder);
}

/* ---- the temporary file ---- */

/* A temporary file that is deleted by the destructor, unless commit() has renamed it. */
class temporary_file
{
  public:
    explicit temporary_file(int folder) : folder_(folder), name_(random_name()), file_(make())
    {
        /* Another process that cleans the folder may have removed the file before it was locked. On file systems
         * without locks no files are removed. */
        struct stat made;
        was_removed_ = flock(file_.number(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
        was_removed_ = was_removed_ || fstat(file_.number(), &made) != 0 || made.st_nlink == 0;
    }
    temporary_file(const temporary_file &) = delete;
    temporary_file &operator=(const temporary_file &) = delete;
    ~temporary_file()
    {
        if (!is_committed_) unlinkat(folder_, name_.c_str(), 0);
    }
    bool was_removed() const { return was_removed_; }
    void write(const unsigned char *bytes, std::size_t size);
    bool commit(const std::string &name);

  private:
    int make() const
    {
        const int number = openat(folder_, name_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
        if (number < 0) fail("", errno);
        return number;
    }

    int folder_;
    std::string name_;
    descriptor file_;
    bool was_removed_ = false, is_committed_ = false;
};

void temporary_file::write(const unsigned char *bytes, std::size_t size)
{
    while (size) {
        const ssize_t written = ::write(file_.number(), bytes, size);
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) fail("", written < 0 ? errno : EIO);
        bytes += written;
        size -= static_cast<std::size_t>(written);
    }
}

/* Closes the file and renames it. Returns false if it no longer exists. Closing releases the lock; some file systems
 * report a full disk only when a file is closed. */
bool temporary_file::commit(const std::string &name)
{
    const int code = file_.close();
    if (code) fail("", code);
    is_committed_ = renameat(folder_, name_.c_str(), folder_, name.c_str()) == 0;
    if (!is_committed_ && errno != ENOENT) fail("", errno);
    return is_committed_;
}

/* ---- the picture ---- */

int open_folder(const std::filesystem::path &folder)
{
    if (!folder.empty()) {
        std::error_code code;
        std::filesystem::create_directories(folder, code);
        if (code) throw io_error("its folder cannot be made: " + code.message());
    }
    const int number = open(folder.empty() ? "." : folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);
    if (number < 0) fail("its folder cannot be opened: ", errno);
    return number;
}

/* Throws unless the name is free, a regular file or a link, because renaming would replace a pipe or a device by the
 * picture. */
void check_rename_target(int folder, const std::string &name)
{
    struct stat found;
    if (name.empty()) fail("", EISDIR);
    if (fstatat(folder, name.c_str(), &found, AT_SYMLINK_NOFOLLOW) != 0) {
        if (errno != ENOENT) fail("", errno);
        return;
    }
    if (S_ISDIR(found.st_mode)) throw io_error("there is a directory of this name");
    if (S_ISFIFO(found.st_mode)) throw io_error("there is a named pipe (FIFO) of this name");
    if (!S_ISREG(found.st_mode) && !S_ISLNK(found.st_mode))
        throw io_error("there is something of this name that is no regular file");
}

bool try_to_write(int folder, const std::string &name, const unsigned char *bytes, std::size_t size)
{
    temporary_file file(folder);
    if (file.was_removed()) return false;
    file.write(bytes, size);
    return file.commit(name);
}

} // namespace

void write_picture_file(const std::string &path, const unsigned char *bytes, std::size_t size)
{
    const std::filesystem::path target(path);
    const std::string name = target.filename().string();
    const descriptor folder(open_folder(target.parent_path()));
    check_rename_target(folder.number(), name);
    remove_stale_files_once(folder.number());
    /* Largest number of attempts to write a picture. Another process may remove the temporary file because it treats
     * the file as one of a killed run: before the file is locked, or if locks do not work across nodes. */
    enum { TRIES = 8 };
    for (int i = 0; i < TRIES; i++)
        if (try_to_write(folder.number(), name, bytes, size)) return;
    throw io_error("its temporary file is removed by another process");
}
