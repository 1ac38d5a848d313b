/* Defines expressions of fields, such as "sqrt(u.x^2 + u.y^2) / a". A text is compiled into a program for a stack
 * machine. The program is run for a block of points at a time. */
#ifndef SCENE_SCENE_EXPRESSION_H
#define SCENE_SCENE_EXPRESSION_H

#include <stdbool.h>

enum {
    SCENE_EXPRESSION_BYTES = 1000, /* maximum length of an expression's text */
    SCENE_BLOCK = 256,             /* maximum number of points for which a program is run at once */
    SCENE_STACK = 32,              /* maximum number of stack entries of a program */
    SCENE_FAULT_SIZE = 400         /* size of the buffer for the description of a fault */
};

/* An operation of a program: a function of one or two numbers, an operator, or an instruction that pushes a number. */
typedef enum scene_operation {
    SCENE_OP_PUSH_NUMBER,
    SCENE_OP_PUSH_INPUT,
    SCENE_OP_NEGATE,
    SCENE_OP_ADD,
    SCENE_OP_SUBTRACT,
    SCENE_OP_MULTIPLY,
    SCENE_OP_DIVIDE,
    SCENE_OP_POWER,
    SCENE_OP_WHOLE_POWER, /* raises to a whole power; the instruction's `number` is the exponent */
    SCENE_OP_SQRT,
    SCENE_OP_ABS,
    SCENE_OP_EXP,
    SCENE_OP_LOG,
    SCENE_OP_LOG10,
    SCENE_OP_SIN,
    SCENE_OP_COS,
    SCENE_OP_TAN,
    SCENE_OP_MIN,
    SCENE_OP_MAX
} scene_operation;

typedef struct scene_instruction {
    scene_operation operation;
    int input;     /* index of the input that SCENE_OP_PUSH_INPUT pushes */
    double number; /* operand of SCENE_OP_PUSH_NUMBER, and exponent of SCENE_OP_WHOLE_POWER */
} scene_instruction;

/* A scalar that an expression reads: the name of a field, and its component as in scene_field.component. */
typedef struct scene_reference {
    char *name;
    int component;
} scene_reference;

typedef struct scene_expression {
    int count;
    scene_instruction *instructions; /* the program; operands come before their operators */
    int depth;                       /* number of stack entries that the program needs, 1 .. SCENE_STACK */
    int input_count;
    scene_reference *inputs; /* scalars that the program reads, without duplicates */
} scene_expression;

typedef enum scene_parse_result { SCENE_PARSED, SCENE_FAULTY, SCENE_NO_MEMORY } scene_parse_result;

/* Parses a text; the locale must be C, in which numbers have a decimal point. If the text is faulty, `fault` receives
 * what was found and what was expected. *out must be freed only if the result is SCENE_PARSED. */
scene_parse_result scene_parse_expression(const char *text, scene_expression *out, char fault[SCENE_FAULT_SIZE]);

void scene_expression_free(scene_expression *expression);

/* Runs the program for `count` points, at most SCENE_BLOCK. inputs: for each input, an array of `count` values. stack:
 * space for depth × SCENE_BLOCK numbers; its first `count` numbers receive the results. */
void scene_evaluate_expression(const scene_expression *expression, const double *const *inputs, int count,
                               double *stack);

#endif
