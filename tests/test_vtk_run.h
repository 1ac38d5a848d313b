/* Declares functions that run programs and return their output, for the tests of insitu-render. */
#ifndef TEST_VTK_RUN_H
#define TEST_VTK_RUN_H

#include <string>
#include <vector>

struct run_result {
    int status; // exit status; -1 if a signal ended the program
    std::string out;
    std::string err;

    bool contains_text(const std::string &text) const { return (out + err).find(text) != std::string::npos; }
};

/* Runs a shell command in a directory. Returns its exit status and what it wrote to stdout and stderr. */
run_result run_in_folder(const std::string &folder, const std::string &command);

std::string quote_for_shell(const std::string &word);

/* Returns an empty directory below the working directory; removes its former contents. */
std::string make_empty_folder(const std::string &name);

void write_file(const std::string &path, const std::string &text);
std::string read_file(const std::string &path);

#endif
