/* Parses expressions by recursive descent along the precedence of operators:
 *
 *     sum     = product { (+ | -) product }
 *     product = sign { (* | /) sign }
 *     sign    = { + | - } power
 *     power   = primary [ ^ sign ]                 so that -x^2 is -(x^2), and x^-1 is allowed
 *     primary = number | ( sum ) | function ( sum [, sum] ) | mag ( field ) | field [. component]
 *
 * An instruction is emitted after the operands of its operator. */
#include "scene_expression.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "scene.h"
#include "scene_shorthand.h"

enum { NAME_SIZE = 256, MOST_NESTED = 64, MOST_WHOLE_POWER = 16 };

static const struct {
    const char *name;
    scene_operation operation;
    int operands;
} functions[] = {{"sqrt", SCENE_OP_SQRT, 1}, {"abs", SCENE_OP_ABS, 1},     {"exp", SCENE_OP_EXP, 1},
                 {"log", SCENE_OP_LOG, 1},   {"log10", SCENE_OP_LOG10, 1}, {"sin", SCENE_OP_SIN, 1},
                 {"cos", SCENE_OP_COS, 1},   {"tan", SCENE_OP_TAN, 1},     {"min", SCENE_OP_MIN, 2},
                 {"max", SCENE_OP_MAX, 2},   {"pow", SCENE_OP_POWER, 2}};
enum { FUNCTIONS = sizeof functions / sizeof *functions };

#define FUNCTION_WORDS "sqrt, abs, exp, log, log10, sin, cos, tan, min, max, pow or mag"

typedef struct parser {
    const char *text, *cursor;
    scene_expression *expression;
    /* number of calls of parse_sign() that have not returned. This is one for the whole expression, plus one for each
     * open bracket, function and exponent; at most MOST_NESTED of these may be open. */
    int nesting_depth;
    int stack_count; /* number of stack entries in use after the instructions emitted so far */
    scene_parse_result result;
    char *fault;
} parser;

static bool parse_sum(parser *p);

__attribute__((format(printf, 2, 3))) static bool fail(parser *p, const char *format, ...)
{
    va_list arguments;
    if (p->result != SCENE_PARSED) return false;
    p->result = SCENE_FAULTY;
    va_start(arguments, format);
    vsnprintf(p->fault, SCENE_FAULT_SIZE, format, arguments);
    va_end(arguments);
    return false;
}

static bool record_out_of_memory(parser *p)
{
    if (p->result == SCENE_PARSED) p->result = SCENE_NO_MEMORY;
    return false;
}

/* ---- characters and words --------------------------------------------------------------------------------------- */

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

/* Returns whether c can be part of a name. Bytes of UTF-8 beyond ASCII are treated as letters. */
static bool is_letter(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || (unsigned char)c >= 0x80;
}

static char skip_blanks_and_peek(parser *p)
{
    while (is_blank(*p->cursor)) p->cursor++;
    return *p->cursor;
}

static bool accept_character(parser *p, char c)
{
    if (skip_blanks_and_peek(p) != c) return false;
    p->cursor++;
    return true;
}

/* Returns the length of the name, number or sign at the start of the text, for a message; 0 at the end of the text. */
static int get_length_of_first_token(const char *at)
{
    int length = 0;
    while (is_letter(at[length]) || is_digit(at[length])) length++;
    return length ? length : *at != '\0';
}

static bool record_unexpected_text(parser *p, const char *expected)
{
    if (skip_blanks_and_peek(p) == '\0') return fail(p, "\"%.60s\" ends too early, expected %s", p->text, expected);
    const int before = (int)(p->cursor - p->text);
    return fail(p, "\"%.*s\" stands behind \"%.*s\", expected %s", get_length_of_first_token(p->cursor), p->cursor,
                before > 40 ? 40 : before, before > 40 ? p->cursor - 40 : p->text, expected);
}

/* ---- emitting instructions -------------------------------------------------------------------------------------- */

static bool add_instruction(parser *p, scene_operation operation, int input, double number)
{
    scene_expression *out = p->expression;
    if (out->count % 16 == 0) {
        scene_instruction *more =
            base_realloc(out->instructions, (size_t)(out->count + 16) * sizeof *out->instructions);
        if (!more) return record_out_of_memory(p);
        out->instructions = more;
    }
    out->instructions[out->count++] = (scene_instruction){operation, input, number};
    return true;
}

static bool add_push_instruction(parser *p, scene_operation operation, int input, double number)
{
    if (++p->stack_count > SCENE_STACK)
        return fail(p, "more than %d intermediate values are open at once, expected fewer brackets or exponents",
                    SCENE_STACK);
    if (p->stack_count > p->expression->depth) p->expression->depth = p->stack_count;
    return add_instruction(p, operation, input, number);
}

static bool add_operator_instruction(parser *p, scene_operation operation)
{
    p->stack_count--;
    return add_instruction(p, operation, 0, 0);
}

/* Emits the instruction for a power. If the exponent is a number, whole and at most MOST_WHOLE_POWER in magnitude, the
 * instruction is SCENE_OP_WHOLE_POWER, which is evaluated by multiplications; otherwise it is SCENE_OP_POWER. */
static bool add_power_instruction(parser *p)
{
    const scene_instruction *last = &p->expression->instructions[p->expression->count - 1];
    const double exponent = last->number;
    if (last->operation != SCENE_OP_PUSH_NUMBER || exponent != floor(exponent) || fabs(exponent) > MOST_WHOLE_POWER)
        return add_operator_instruction(p, SCENE_OP_POWER);
    p->expression->count--;
    p->stack_count--;
    return add_instruction(p, SCENE_OP_WHOLE_POWER, 0, exponent);
}

/* ---- parsing fields and functions ------------------------------------------------------------------------------- */

static bool add_push_input_instruction(parser *p, const char *name, int component)
{
    scene_expression *out = p->expression;
    for (int i = 0; i < out->input_count; i++)
        if (strcmp(out->inputs[i].name, name) == 0 && out->inputs[i].component == component)
            return add_push_instruction(p, SCENE_OP_PUSH_INPUT, i, 0);
    scene_reference *inputs = base_realloc(out->inputs, (size_t)(out->input_count + 1) * sizeof *inputs);
    if (!inputs) return record_out_of_memory(p);
    out->inputs = inputs;
    inputs[out->input_count] = (scene_reference){base_strdup(name), component};
    if (!inputs[out->input_count].name) return record_out_of_memory(p);
    return add_push_instruction(p, SCENE_OP_PUSH_INPUT, out->input_count++, 0);
}

/* Reads the component that follows a point (.x, .y, .z or a number). */
static bool parse_component(parser *p, const char *name, int *component)
{
    const char *word = p->cursor;
    const int length = get_length_of_first_token(word), digits = (int)strspn(word, "0123456789");
    p->cursor += length;
    if (length == 1 && *word >= 'x' && *word <= 'z') {
        *component = *word - 'x';
        return true;
    }
    if (digits && digits == length && digits <= 3) {
        *component = (int)strtol(word, NULL, 10);
        return true;
    }
    return fail(p, "\"%.60s.%.*s\" names no component, expected .x, .y, .z or a number from .0 to .999", name,
                length > 20 ? 20 : length, word);
}

/* Reads a name, with or without quotes, that begins at p->cursor. */
static bool parse_name(parser *p, char name[NAME_SIZE])
{
    const char quote = *p->cursor == '"' || *p->cursor == '\'' ? *p->cursor : '\0';
    const char *begin = p->cursor + (quote != '\0'), *end = begin;
    while (quote ? *end && *end != quote : is_letter(*end) || is_digit(*end)) end++;
    if (quote && !*end) return fail(p, "the name %.40s has no end, expected %c behind it", p->cursor, quote);
    if (end == begin || end - begin >= NAME_SIZE)
        return fail(p, "a name of %d bytes stands there, expected 1 to %d", (int)(end - begin), NAME_SIZE - 1);
    memcpy(name, begin, (size_t)(end - begin));
    name[end - begin] = '\0';
    p->cursor = end + (quote != '\0');
    return true;
}

static bool is_start_of_name(char c)
{
    return is_letter(c) || c == '"' || c == '\'';
}

static bool parse_argument_of_magnitude(parser *p)
{
    char name[NAME_SIZE];
    if (!is_start_of_name(skip_blanks_and_peek(p)))
        return record_unexpected_text(p, "the name of a field, as in mag(velocity)");
    if (!parse_name(p, name)) return false;
    if (!accept_character(p, ')'))
        return record_unexpected_text(p, ") behind the field's name: mag takes a field alone");
    return add_push_input_instruction(p, name, SCENE_COMPONENT_MAGNITUDE);
}

static bool parse_function_arguments(parser *p, int function)
{
    const int expected = functions[function].operands;
    int found = 0;
    do {
        if (!parse_sum(p)) return false;
        found++;
    } while (accept_character(p, ','));
    if (!accept_character(p, ')')) return record_unexpected_text(p, "an operator, a comma or )");
    if (found != expected) return fail(p, "%s has %d operands, expected %d", functions[function].name, found, expected);
    if (functions[function].operation == SCENE_OP_POWER) return add_power_instruction(p);
    return expected == 2 ? add_operator_instruction(p, functions[function].operation)
                         : add_instruction(p, functions[function].operation, 0, 0);
}

static bool fail_for_unknown_function(parser *p, const char *name)
{
    const char *names[FUNCTIONS + 1] = {"mag"};
    for (int i = 0; i < FUNCTIONS; i++) names[i + 1] = functions[i].name;
    const char *meant = scene_find_most_similar_word(name, names, FUNCTIONS + 1);
    if (strcmp(name, "magnitude") == 0) meant = "mag";
    return fail(p, "\"%.60s\" is no function%s%s%s, expected " FUNCTION_WORDS, name, meant ? " (did you mean " : "",
                meant ? meant : "", meant ? "?)" : "");
}

static bool parse_function(parser *p, const char *name)
{
    int function = 0;
    while (function < FUNCTIONS && strcmp(functions[function].name, name) != 0) function++;
    if (strcmp(name, "mag") == 0) return parse_argument_of_magnitude(p);
    if (function == FUNCTIONS) return fail_for_unknown_function(p, name);
    return parse_function_arguments(p, function);
}

static bool parse_field_or_function(parser *p)
{
    char name[NAME_SIZE];
    const bool is_quoted = !is_letter(*p->cursor);
    int component = SCENE_COMPONENT_ONLY;
    if (!parse_name(p, name)) return false;
    if (!is_quoted && accept_character(p, '(')) return parse_function(p, name);
    if (*p->cursor == '.') {
        p->cursor++;
        if (!parse_component(p, name, &component)) return false;
    }
    return add_push_input_instruction(p, name, component);
}

/* ---- parsing the rules of the grammar --------------------------------------------------------------------------- */

static bool parse_number(parser *p)
{
    char digits[64];
    const char *end = p->cursor;
    while (is_digit(*end)) end++;
    if (*end == '.') end++;
    while (is_digit(*end)) end++;
    if ((*end == 'e' || *end == 'E') && (is_digit(end[1]) || ((end[1] == '-' || end[1] == '+') && is_digit(end[2])))) {
        end += 2;
        while (is_digit(*end)) end++;
    }
    const size_t length = (size_t)(end - p->cursor);
    if (length >= sizeof digits)
        return fail(p, "the number %.40s... is too long, expected at most 63 digits", p->cursor);
    memcpy(digits, p->cursor, length);
    digits[length] = '\0';
    const double number = strtod(digits, NULL);
    if (!isfinite(number)) return fail(p, "the number %s is too large, expected one below 1.8e308", digits);
    p->cursor = end;
    return add_push_instruction(p, SCENE_OP_PUSH_NUMBER, 0, number);
}

static bool parse_primary(parser *p)
{
    const char c = skip_blanks_and_peek(p);
    if (is_digit(c) || (c == '.' && is_digit(p->cursor[1]))) return parse_number(p);
    if (is_start_of_name(c)) return parse_field_or_function(p);
    if (!accept_character(p, '(')) return record_unexpected_text(p, "a number, a field or (");
    if (!parse_sum(p)) return false;
    return accept_character(p, ')') || record_unexpected_text(p, "an operator or )");
}

static bool parse_sign(parser *p);

static bool parse_power(parser *p)
{
    if (!parse_primary(p)) return false;
    if (p->cursor[0] == '*' && p->cursor[1] == '*')
        return fail(p, "** is no operator (did you mean ^?), expected + - * / or ^");
    if (!accept_character(p, '^')) return true;
    const int before = p->expression->count;
    if (!parse_sign(p)) return false;
    const scene_instruction *last = &p->expression->instructions[p->expression->count - 1];
    const bool is_negative = last->operation == SCENE_OP_NEGATE && p->expression->count == before + 2;
    if (is_negative && p->expression->instructions[before].operation == SCENE_OP_PUSH_NUMBER) {
        p->expression->count--;
        p->expression->instructions[before].number *= -1;
    }
    return add_power_instruction(p);
}

static bool parse_sign(parser *p)
{
    bool is_negative = false;
    for (; skip_blanks_and_peek(p) == '-' || *p->cursor == '+'; p->cursor++)
        is_negative = is_negative != (*p->cursor == '-');
    if (p->nesting_depth++ > MOST_NESTED)
        return fail(p, "more than %d brackets and functions are nested, expected fewer", MOST_NESTED);
    if (!parse_power(p)) return false;
    p->nesting_depth--;
    return !is_negative || add_instruction(p, SCENE_OP_NEGATE, 0, 0);
}

static bool parse_product(parser *p)
{
    if (!parse_sign(p)) return false;
    while (skip_blanks_and_peek(p) == '*' || *p->cursor == '/') {
        const scene_operation operation = *p->cursor++ == '*' ? SCENE_OP_MULTIPLY : SCENE_OP_DIVIDE;
        if (!parse_sign(p) || !add_operator_instruction(p, operation)) return false;
    }
    return true;
}

static bool parse_sum(parser *p)
{
    if (!parse_product(p)) return false;
    while (skip_blanks_and_peek(p) == '+' || *p->cursor == '-') {
        const scene_operation operation = *p->cursor++ == '+' ? SCENE_OP_ADD : SCENE_OP_SUBTRACT;
        if (!parse_product(p) || !add_operator_instruction(p, operation)) return false;
    }
    return true;
}

scene_parse_result scene_parse_expression(const char *text, scene_expression *out, char fault[SCENE_FAULT_SIZE])
{
    parser p = {.text = text, .cursor = text, .expression = out, .fault = fault};
    *out = (scene_expression){0};
    if (strlen(text) > SCENE_EXPRESSION_BYTES)
        fail(&p, "an expression of %zu bytes stands there, expected at most %d", strlen(text), SCENE_EXPRESSION_BYTES);
    else if (parse_sum(&p) && skip_blanks_and_peek(&p) != '\0')
        record_unexpected_text(&p, "an operator (+ - * / ^) or the end");
    if (p.result != SCENE_PARSED) scene_expression_free(out);
    return p.result;
}

void scene_expression_free(scene_expression *expression)
{
    for (int i = 0; i < expression->input_count; i++) base_free(expression->inputs[i].name);
    base_free(expression->inputs);
    base_free(expression->instructions);
    *expression = (scene_expression){0};
}

/* ---- evaluation ------------------------------------------------------------------------------------------------- */

#define FOR_EACH(...)                                                                                                  \
    for (int i = 0; i < count; i++) __VA_ARGS__

static double compute_integer_power(double base, int exponent)
{
    double power = 1;
    for (int left = abs(exponent); left; left >>= 1, base *= base)
        if (left & 1) power *= base;
    return exponent < 0 ? 1 / power : power;
}

static void raise_values_to_integer_power(double *restrict a, int exponent, int count)
{
    if (exponent == 2)
        FOR_EACH(a[i] *= a[i]);
    else
        FOR_EACH(a[i] = compute_integer_power(a[i], exponent));
}

static void apply_function_to_array(scene_operation operation, double *restrict a, int count)
{
    switch (operation) {
    case SCENE_OP_NEGATE: FOR_EACH(a[i] = -a[i]); break;
    case SCENE_OP_SQRT: FOR_EACH(a[i] = sqrt(a[i])); break;
    case SCENE_OP_ABS: FOR_EACH(a[i] = fabs(a[i])); break;
    case SCENE_OP_EXP: FOR_EACH(a[i] = exp(a[i])); break;
    case SCENE_OP_LOG: FOR_EACH(a[i] = log(a[i])); break;
    case SCENE_OP_LOG10: FOR_EACH(a[i] = log10(a[i])); break;
    case SCENE_OP_SIN: FOR_EACH(a[i] = sin(a[i])); break;
    case SCENE_OP_COS: FOR_EACH(a[i] = cos(a[i])); break;
    default: FOR_EACH(a[i] = tan(a[i])); break;
    }
}

/* Applies the operator to `count` pairs of numbers a and b, and stores the results in a. If one number is NaN, the
 * minimum and the maximum are NaN. */
static void apply_operator_to_arrays(scene_operation operation, double *restrict a, const double *restrict b, int count)
{
    switch (operation) {
    case SCENE_OP_ADD: FOR_EACH(a[i] += b[i]); break;
    case SCENE_OP_SUBTRACT: FOR_EACH(a[i] -= b[i]); break;
    case SCENE_OP_MULTIPLY: FOR_EACH(a[i] *= b[i]); break;
    case SCENE_OP_DIVIDE: FOR_EACH(a[i] /= b[i]); break;
    case SCENE_OP_POWER: FOR_EACH(a[i] = pow(a[i], b[i])); break;
    case SCENE_OP_MIN: FOR_EACH(a[i] = b[i] < a[i] || b[i] != b[i] ? b[i] : a[i]); break;
    default: FOR_EACH(a[i] = b[i] > a[i] || b[i] != b[i] ? b[i] : a[i]); break;
    }
}

static bool is_binary_operation(scene_operation operation)
{
    return (operation >= SCENE_OP_ADD && operation <= SCENE_OP_POWER) || operation == SCENE_OP_MIN ||
           operation == SCENE_OP_MAX;
}

void scene_evaluate_expression(const scene_expression *expression, const double *const *inputs, int count,
                               double *stack)
{
    double *top = stack - SCENE_BLOCK; /* top entry of the stack; an entry is a block of SCENE_BLOCK numbers */
    for (int k = 0; k < expression->count; k++) {
        const scene_instruction *at = &expression->instructions[k];
        if (at->operation == SCENE_OP_PUSH_NUMBER) {
            top += SCENE_BLOCK;
            FOR_EACH(top[i] = at->number);
        } else if (at->operation == SCENE_OP_PUSH_INPUT) {
            top += SCENE_BLOCK;
            memcpy(top, inputs[at->input], (size_t)count * sizeof *top);
        } else if (at->operation == SCENE_OP_WHOLE_POWER) {
            raise_values_to_integer_power(top, (int)at->number, count);
        } else if (is_binary_operation(at->operation)) {
            top -= SCENE_BLOCK;
            apply_operator_to_arrays(at->operation, top, top + SCENE_BLOCK, count);
        } else {
            apply_function_to_array(at->operation, top, count);
        }
    }
}
