/* Some of VTK's readers only warn where a file ends too early, and go on with whatever their memory held. So a warning
 * about reading counts as an error. */
#include "vtk_messages.h"

#include <cctype>
#include <cstring>
#include <stdexcept>

#include <fcntl.h>
#include <unistd.h>

#include <vtkLogger.h>
#include <vtkObjectFactory.h>
#include <vtkOutputWindow.h>

namespace render_tool
{

namespace
{

bool contains_any(const char *text, std::initializer_list<const char *> parts)
{
    for (const char *part : parts)
        if (std::strstr(text, part)) return true;
    return false;
}

/* Takes the place of VTK's output window: keeps the first error, drops the rest. */
class message_catcher : public vtkOutputWindow
{
  public:
    static message_catcher *New();
    vtkTypeMacro(message_catcher, vtkOutputWindow);

    void DisplayText(const char *) override {}
    void DisplayDebugText(const char *) override {}
    void DisplayWarningText(const char *text) override { keep_if_serious(text); }
    void DisplayGenericWarningText(const char *text) override { keep_if_serious(text); }
    void DisplayErrorText(const char *text) override
    {
        /* VTK's own writer leaves out the points of a grid without cells, which its reader then reports. */
        if (text && !contains_any(text, {"No Points element available in first piece"})) keep(text);
    }

    std::string first_error;

  private:
    void keep(const char *text)
    {
        if (first_error.empty()) first_error = text;
    }
    void keep_if_serious(const char *text)
    {
        if (text && contains_any(text, {"rror reading", "Premature EOF", "ends prematurely", "Unexpected EOF"}))
            keep(text);
    }
};

vtkStandardNewMacro(message_catcher)

    message_catcher *catcher = nullptr; // owned by VTK from catch_vtk_messages() on

/* VTK writes "ERROR: In file, line n\nclass (0x...): what\n\n", the class only if there is one. Only the last part is
 * of use to a person. */
std::string plain_words(std::string text)
{
    if (text.find("returned failure for request") != std::string::npos) return "VTK's reader failed";
    const size_t address = text.find("): "), first_line = text.find('\n');
    if (address != std::string::npos)
        text.erase(0, address + 3);
    else if (first_line != std::string::npos && text.find(": In ") < first_line)
        text.erase(0, first_line + 1);
    while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
    for (char &c : text)
        if (c == '\n') c = ' ';
    return text;
}

} // namespace

void catch_vtk_messages()
{
    if (catcher) return;
    vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_OFF);
    catcher = message_catcher::New();
    vtkOutputWindow::SetInstance(catcher);
    catcher->UnRegister(nullptr);
}

void throw_caught(const std::string &path)
{
    if (!catcher || catcher->first_error.empty()) return;
    const std::string text = plain_words(catcher->first_error);
    catcher->first_error.clear();
    throw std::runtime_error(path + ": cannot be read: " + text);
}

quiet_stderr::quiet_stderr() : kept_(dup(STDERR_FILENO))
{
    const int nowhere = open("/dev/null", O_WRONLY);
    if (kept_ >= 0 && nowhere >= 0) dup2(nowhere, STDERR_FILENO);
    if (nowhere >= 0) close(nowhere);
}

quiet_stderr::~quiet_stderr()
{
    if (kept_ < 0) return;
    dup2(kept_, STDERR_FILENO);
    close(kept_);
}

} // namespace render_tool
