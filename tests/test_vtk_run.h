/* Runs programs and checks their output, for the tests of insitu-render. */
#ifndef TEST_VTK_RUN_H
#define TEST_VTK_RUN_H

#include <string>
#include <vector>

struct run_result {
    int status; // of exit; -1: ended by a signal
    std::string out;
    std::string err;

    bool says(const std::string &text) const { return (out + err).find(text) != std::string::npos; }
};

/* Run a shell command in folder; on a failure of the expectation that follows, out and err are there to be printed. */
run_result run_in(const std::string &folder, const std::string &command);

std::string shell_word(const std::string &word);

/* An empty folder below the working directory, made anew. */
std::string fresh_folder(const std::string &name);

void write_file(const std::string &path, const std::string &text);
std::string read_file(const std::string &path);

#endif
