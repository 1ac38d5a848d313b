/* Some of VTK's readers only warn if a file ends too early, and continue with uninitialized memory. Warnings during
 * reading are therefore treated as errors. */
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

/* Replaces VTK's output window. Stores the first error, or warning of a truncated file, and discards all other
 * messages. */
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
        /* This message is not an error, because VTK's own writer omits the points of a grid without cells. */
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

    message_catcher *catcher = nullptr; // the output window, which VTK owns after catch_vtk_messages()

/* Extracts the part of VTK's messages that is useful to the user. A message begins with "ERROR: In file, line n",
 * continues on the next line with "class (0x...): " and the useful text, and ends with empty lines. The class may be
 * missing. */
std::string extract_message_text(std::string text)
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

void throw_pending_message(const std::string &path)
{
    if (!catcher || catcher->first_error.empty()) return;
    const std::string text = extract_message_text(catcher->first_error);
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
