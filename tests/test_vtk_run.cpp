#include "test_vtk_run.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <sys/wait.h>

std::string quote_for_shell(const std::string &word)
{
    std::string q = "'";
    for (const char c : word) q += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return q + "'";
}

run_result run_in_folder(const std::string &folder, const std::string &command)
{
    const std::string out = folder + "/.stdout", err = folder + "/.stderr";
    const std::string all = "cd " + quote_for_shell(folder) + " && { " + command + "; } >" + quote_for_shell(out) +
                            " 2>" + quote_for_shell(err);
    const int status = std::system(all.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(out), read_file(err)};
}

std::string make_empty_folder(const std::string &name)
{
    const std::filesystem::path folder = std::filesystem::current_path() / name;
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    return folder.string();
}

void write_file(const std::string &path, const std::string &text)
{
    std::ofstream(path, std::ios::binary) << text;
}

std::string read_file(const std::string &path)
{
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
}
