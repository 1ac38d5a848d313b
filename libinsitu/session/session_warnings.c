/* What was told is kept as hashes of what it was about. */
#include "session_warnings.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "memory.h"

static uint64_t key_of(const session_warning *w)
{
    const char *const texts[2] = {w->image ? w->image : "", w->mesh ? w->mesh : ""};
    const int numbers[2] = {(int)w->kind, w->number};
    uint64_t key = SESSION_HASH_BEGIN;
    session_hash_bytes(&key, numbers, sizeof numbers);
    for (int i = 0; i < 2; i++) session_hash_bytes(&key, texts[i], strlen(texts[i]) + 1);
    return key;
}

/* told_count: not among them. */
static int find_told(const insitu_session *session, uint64_t key)
{
    int at = 0;
    while (at < session->told_count && session->told[at] != key) at++;
    return at;
}

/* Where memory runs out the warning is told again. */
static void add_told(insitu_session *session, uint64_t key)
{
    uint64_t *told = base_realloc(session->told, (size_t)(session->told_count + 1) * sizeof *told);
    if (!told) return;
    session->told = told;
    told[session->told_count++] = key;
}

void session_warn(insitu_session *session, const session_warning *warning, bool holds, const char *format, ...)
{
    const uint64_t key = key_of(warning);
    const int at = find_told(session, key);
    if (holds && at == session->told_count) {
        char line[1024];
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(line, sizeof line, format, arguments);
        va_end(arguments);
        session_text_add(&session->warnings, "%s", line);
        add_told(session, key);
    } else if (!holds && at < session->told_count) {
        session->told[at] = session->told[--session->told_count];
    }
}

bool session_is_warned(const insitu_session *session, const session_warning *warning)
{
    return find_told(session, key_of(warning)) < session->told_count;
}

void session_forget_warnings(insitu_session *session)
{
    session->told_count = 0;
}
