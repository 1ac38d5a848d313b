/* Prints docs/scene.md from the schema that reads scene files. With a file's name: says where that file differs, and
 * fails if it does. `ninja scene_docs` writes the page anew. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene_words.h"

static const char introduction[] =
    "# The scene file\n"
    "\n"
    "A scene file says what to draw, when, and where to put it. It is YAML. It is read on rank 0, and read again when "
    "it\n"
    "changes, so that the pictures of a running job can be changed. A key that is unknown, of the wrong type or out\n"
    "of range is an error that names the file, the line, the key, and what was expected; anchors, aliases and tags "
    "are\n"
    "not taken.\n"
    "\n"
    "```yaml\n"
    "images:\n"
    "  - name: wave\n"
    "    size: [1280, 720]\n"
    "    camera: {automatic: {direction: [1, 0.8, 1.2]}}\n"
    "    layers:\n"
    "      - isosurface: {field: pressure, values: [0.2, 0.5]}\n"
    "      - volume: {field: pressure, map: cool_to_warm, opacity: [[0, 0], [0.4, 0.3], [1, 0.9]]}\n"
    "    outputs:\n"
    "      - path: \"out/{name}_{cycle:06}.png\"\n"
    "```\n"
    "\n"
    "More stand in [examples](../examples). Colours are sRGB, from 0 to 1. Lengths are those of the mesh's "
    "coordinates.\n"
    "This page is printed from the schema that the library reads scene files by.\n"
    "\n"
    "## Short forms\n"
    "\n"
    "| may be written | instead of |\n"
    "|---|---|\n"
    "| `colour: orange`, `colour: \"#ffa500\"` (in quotes, because `#` begins a comment) | a list of three numbers; "
    "so too `background`, `below`, `above`, `nan` and the entries of `colours`. Names are those of CSS. |\n"
    "| `normal: z`, `direction: -x` | a list of three numbers; so too `up` and `axis` |\n"
    "| `colour_bar: true`, `colour_bar: false` | `colour_bar: {}`, or no such key; so too `scale_bar`, `edges`, "
    "`ambient_occlusion` and `automatic` |\n"
    "| `camera: automatic` | `camera: {automatic: {}}` |\n"
    "| `values: 0.5` | `values: [0.5]` |\n"
    "| `colour_by: pressure` | `colour_by: {field: pressure}` |\n"
    "| one mapping at `planes`, `lights`, `outputs`, `text` | a list of it |\n"
    "| `outputs: a.png` | `outputs: [{path: a.png}]`; so too entries of the list |\n"
    "| `color`, `center` in a key | `colour`, `centre` |\n"
    "\n"
    "## Derived fields\n"
    "\n"
    "`fields` makes fields of the simulation's, and names them. Layers, colours, ranges, statistics, thresholds and\n"
    "`when` use them as any other:\n"
    "\n"
    "```yaml\n"
    "fields:\n"
    "  speed: mag(velocity)\n"
    "  mach: speed / sound\n"
    "  q: {q_criterion: velocity}\n"
    "  spin: {vorticity: velocity, component: z}\n"
    "  heating: {gradient: temperature}\n"
    "images:\n"
    "  - name: vortices\n"
    "    layers:\n"
    "      - isosurface: {field: q, values: 40, colour_by: {field: speed}}\n"
    "    outputs: [{path: \"vortices_{cycle:06}.png\"}]\n"
    "```\n"
    "\n"
    "| written | is | components | order of its error |\n"
    "|---|---|---|---|\n"
    "| a text | an expression: numbers, fields, `u.x`, `+ - * / ^`, brackets, functions | 1 | none |\n"
    "| `{magnitude: u}`, `{field: u, component: y}` | the magnitude or a component of a field | 1 | none |\n"
    "| `{gradient: p}` | its slopes | 3, or with `component` 1 | 2; 1 at the border |\n"
    "| `{divergence: u}` | the sum of the slopes of each component along its axis | 1 | 2; 1 at the border |\n"
    "| `{vorticity: u}` | the curl | 3, or with `component` 1 | 2; 1 at the border |\n"
    "| `{q_criterion: u}`, `{lambda2: u}` | criteria of vortices: Q > 0, lambda2 < 0 | 1 | 2; 1 at the border |\n"
    "| `{strain_rate: u}` | sqrt(2 S:S), S being half of the slopes and their transposed | 1 | 2; 1 at the border |\n"
    "\n"
    "Gradients are found at vertices, from all cells around each, on all ranks and on all meshes that have the field "
    "as\n"
    "one, so that no border of ranks or blocks shows and any partition gives the same bits. Of a linear field they "
    "are\n"
    "exact on every cell type. The order is that of lattices whose cells turn and stretch gradually; where cells are\n"
    "moved at random an error of first order, of their amount, remains. On meshes of triangles, quads and polygons "
    "alone\n"
    "gradients lie in the cells' planes. Values in cells are taken to the vertices first, which has an error of "
    "second\n"
    "order of its own, and of first at the border unless the field has values there (`insitu_patch`). An expression "
    "of\n"
    "fields in cells alone is a field in cells, without values on the boundary.\n"
    "\n"
    "Values are made in the steps that need them, and again where what they are made of, or for gradients the mesh, "
    "has\n"
    "changed. A component takes 4 bytes a vertex or cell, 8 where a field that it is made of has 8; the report says "
    "so.\n"
    "While gradients of a vector are found, some 220 bytes a vertex are held. A number that is not finite makes the\n"
    "values that depend on it so, and those cells are not drawn; of gradients, cells with such a vertex do not count.\n"
    "A derived field is on the meshes that have all that it is made of.\n";

enum { MOST_MAPPINGS = 128 };
static const scene_mapping *shown[MOST_MAPPINGS];
static int shown_count;

/* Mappings with their paths in the file, each once, in the order a reader meets them. */
static void print_mapping(FILE *to, const scene_mapping *mapping, const char *path)
{
    for (int i = 0; i < shown_count; i++) {
        if (shown[i] == mapping) return;
    }
    if (shown_count == MOST_MAPPINGS) {
        fputs("scene_reference: there are more mappings than MOST_MAPPINGS\n", stderr);
        exit(1);
    }
    shown[shown_count++] = mapping;
    fprintf(to, "\n## %s\n\n| key | value | default | meaning |\n|---|---|---|---|\n", *path ? path : "The file");
    for (int i = 0; mapping->fields[i].key; i++) {
        const scene_key *key = &mapping->keys[i];
        char words[SCENE_WORDS_SIZE];
        scene_value_words(&mapping->fields[i].value, key, words);
        char *keys = strstr(words, " with the keys");
        if (keys) *keys = '\0';
        fprintf(to, "| `%s` | %s | %s | %s |\n", mapping->fields[i].key, words,
                key->default_text ? key->default_text : "**required**", key->help);
    }
    for (int i = 0; mapping->fields[i].key; i++) {
        for (int form = 0; form < mapping->keys[i].form_count; form++) {
            char below[256];
            snprintf(below, sizeof below, "%s.%s", path, mapping->fields[i].key);
            if (mapping->keys[i].forms[form].key.child)
                print_mapping(to, mapping->keys[i].forms[form].key.child, below);
        }
        if (!mapping->keys[i].child) continue;
        char below[256];
        const bool is_list = mapping->fields[i].value.type == CYAML_SEQUENCE;
        snprintf(below, sizeof below, "%s%s%s%s", path, *path ? "." : "", mapping->fields[i].key, is_list ? "[]" : "");
        print_mapping(to, mapping->keys[i].child, below);
    }
}

static int compare(FILE *expected, const char *file_name)
{
    FILE *found = fopen(file_name, "r");
    if (!found) {
        fprintf(stderr, "%s: cannot be read\n", file_name);
        return EXIT_FAILURE;
    }
    char a[2048], b[2048];
    bool is_same = true;
    for (int line = 1; is_same; line++) {
        const char *in_a = fgets(a, sizeof a, expected), *in_b = fgets(b, sizeof b, found);
        if (!in_a && !in_b) break;
        is_same = in_a && in_b && strcmp(a, b) == 0;
        if (!is_same) {
            fprintf(stderr, "%s:%d: is\n%sexpected (build the target scene_docs)\n%s", file_name, line,
                    in_b ? b : "the end\n", in_a ? a : "the end\n");
        }
    }
    fclose(found);
    return is_same ? EXIT_SUCCESS : EXIT_FAILURE;
}

int main(int argument_count, char **arguments)
{
    FILE *page = argument_count > 1 ? tmpfile() : stdout;
    if (!page) return EXIT_FAILURE;
    fputs(introduction, page);
    print_mapping(page, &scene_top, "");
    if (argument_count == 1) return EXIT_SUCCESS;
    rewind(page);
    const int result = compare(page, arguments[1]);
    fclose(page);
    return result;
}
