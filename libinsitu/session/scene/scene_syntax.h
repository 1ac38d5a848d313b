/* Describes why a text is not valid YAML, in words that help the author of the text: names the faulty line, and the
 * text that the line should contain. */
#ifndef SCENE_SCENE_SYNTAX_H
#define SCENE_SCENE_SYNTAX_H

#include <stddef.h>

#include <yaml.h>

enum { SCENE_SYNTAX_SIZE = 300 };

/* Describes the error that a parser found in the text. *line receives the line of the mistake, counted from 1. */
void scene_describe_syntax_error(const yaml_parser_t *parser, const char *text, size_t size, size_t *line,
                                 char words[SCENE_SYNTAX_SIZE]);

/* Returns the text of the value that a # turned into a comment on the line (from 1), such as #ff0000 in "colour:
 * #ff0000", and stores its length; returns NULL if there is none. */
const char *scene_find_colour_in_comment(const char *text, size_t size, size_t line, size_t *length);

#endif
