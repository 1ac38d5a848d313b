/* What is wrong with a text that is not YAML, as its writer would say it: the line at fault and what to write there. */
#ifndef SCENE_SCENE_SYNTAX_H
#define SCENE_SCENE_SYNTAX_H

#include <stddef.h>

#include <yaml.h>

enum { SCENE_SYNTAX_SIZE = 300 };

/* Words the error that a parser has met in the text: sets *line, counted from 1. */
void scene_syntax_words(const yaml_parser_t *parser, const char *text, size_t size, size_t *line,
                        char words[SCENE_SYNTAX_SIZE]);

/* The text of a value on the line (from 1) that a # has made a comment, as #ff0000 in "colour: #ff0000", to *length;
 * NULL: there is none. */
const char *scene_syntax_comment(const char *text, size_t size, size_t line, size_t *length);

#endif
