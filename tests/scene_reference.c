/* Prints docs/scene.md from the schema that the scene parser uses. If a file name is given as an argument, compares the
 * output with that file, reports the first difference and fails if there is one. `ninja scene_docs` writes the page
 * anew. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene_words.h"

static const char introduction[] =
    "# The scene file\n"
    "\n"
    "A scene file describes what to draw, when to draw it, and where to write the pictures. Its format is YAML. Rank "
    "0\n"
    "reads the file, and reads it again when it changes, so you can change the pictures of a running job. If a key is\n"
    "unknown, of the wrong type or out of range, this is an error that names the file, the line, the key, and what "
    "was\n"
    "expected. Anchors, aliases and tags of YAML are not accepted.\n"
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
    "There are more scenes in [examples](../examples). The numbers of colours are sRGB, from 0 to 1. Lengths are in "
    "the\n"
    "units of the mesh's coordinates, which are called scene units here. This page is printed from the schema by which "
    "the\n"
    "library reads scene files.\n"
    ""
    "\n"
    "## Short forms\n"
    "\n"
    "| short form | full form |\n"
    "|---|---|\n"
    "| `colour: orange`, `colour: \"#ffa500\"` (in quotes, because `#` begins a comment) | a list of three numbers; "
    "this also applies to `background`, `below`, `above`, `nan` and the entries of `colours`. Names are those of CSS. "
    "|\n"
    "| `normal: z`, `direction: -x` | a list of three numbers; this also applies to `up` and `axis` |\n"
    "| `colour_bar: true`, `colour_bar: false` | `colour_bar: {}`, or no such key; this also applies to `scale_bar`, "
    "`edges`, `ambient_occlusion` and `automatic` |\n"
    "| `camera: automatic` | `camera: {automatic: {}}` |\n"
    "| `values: 0.5` | `values: [0.5]` |\n"
    "| `colour_by: pressure` | `colour_by: {field: pressure}` |\n"
    "| one mapping at `planes`, `lights`, `outputs`, `text` | a list that contains this mapping |\n"
    "| `outputs: a.png` | `outputs: [{path: a.png}]`; this also applies to entries of the list |\n"
    "| `color`, `center` in a key | `colour`, `centre` |\n"
    "\n"
    "## Derived fields\n"
    "\n"
    "The key `fields` computes new fields from the simulation's fields, and gives them names. Layers, colours, "
    "ranges,\n"
    "statistics, thresholds and `when` can use these names like those of other fields:\n"
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
    "| definition | result | components | order of its error |\n"
    "|---|---|---|---|\n"
    "| a text | an expression: numbers, fields, `u.x`, `+ - * / ^`, brackets, functions | 1 | none |\n"
    "| `{magnitude: u}`, `{field: u, component: y}` | the magnitude or a component of a field | 1 | none |\n"
    "| `{gradient: p}` | the gradient | 3, or 1 with `component` | 2; 1 at the boundary |\n"
    "| `{divergence: u}` | the sum of the derivatives of each component along its axis | 1 | 2; 1 at the boundary |\n"
    "| `{vorticity: u}` | the curl | 3, or 1 with `component` | 2; 1 at the boundary |\n"
    "| `{q_criterion: u}`, `{lambda2: u}` | criteria for vortices: Q > 0, lambda2 < 0 | 1 | 2; 1 at the boundary |\n"
    "| `{strain_rate: u}` | sqrt(2 S:S), where S is half of the sum of the velocity gradient and its transpose | 1 | "
    "2; 1 at the boundary |\n"
    "\n"
    "**Gradients** are computed at the vertices. Each uses all cells around the vertex, on all ranks and on all meshes "
    "that\n"
    "have the field. Borders of ranks or blocks are therefore not visible, and the gradients are bit-identical on any "
    "partition.\n"
    ""
    "\n"
    "- The gradient of a linear field is exact on every cell type.\n"
    "- The orders in the table hold for lattices whose cells turn and stretch gradually. If vertices are moved at "
    "random,\n"
    ""
    "  an error of first order remains, which is proportional to this displacement.\n"
    "- On meshes that have only triangles, quads and polygons, gradients lie in the planes of the cells.\n"
    "- Cell values are first averaged at the vertices. This has an error of second order of its own. At the boundary "
    "it is\n"
    "  of first order, unless the field has values there (`insitu_patch`).\n"
    "\n"
    "**Expressions** that use only cell fields give a cell field, without values on the boundary.\n"
    "\n"
    "**When and where.** A derived field is computed in the steps that need it. It is computed again if the fields "
    "that it\n"
    "uses have changed, or, for gradients, the mesh. It exists on those meshes that have all fields that it uses.\n"
    "\n"
    "**Memory.** A component takes 4 bytes per vertex or cell, or 8 if it uses a field of 8 bytes. The report states "
    "this.\n"
    ""
    "While gradients of a vector are computed, some 220 bytes per vertex are held.\n"
    "\n"
    "**Values that are not finite.** Values that depend on a number that is not finite are not finite either. The\n"
    "same holds for components of 4 bytes that exceed 3.4e38. Isosurfaces and volumes do not show cells with such "
    "values.\n"
    "Where such values give the colours of surfaces, isosurfaces and slices, the colour is `nan`. A warning states the "
    "number\n"
    "of cells. Gradients ignore cells that have a vertex with such a value.\n"
    "\n"
    "## Warped meshes\n"
    "\n"
    "`warp` draws a mesh with its vertices moved by a field of displacements:\n"
    "\n"
    "```yaml\n"
    "meshes:\n"
    "  plate: {warp: {field: DISPL, scale: 10}}   # at x + 10 * DISPL\n"
    "  frame: {warp: DISPL}                       # at x + DISPL\n"
    "images:\n"
    "  - name: bent\n"
    "    layers:\n"
    "      - surface: {colour_by: {field: stress}}\n"
    "    outputs: [{path: \"bent_{cycle:06}.png\"}]\n"
    "```\n"
    "\n"
    "Everything in the scene uses the warped mesh instead of the given one: all layers of all images, the bounds of "
    "the data\n"
    "and automatic cameras, clips, planes, the surfaces of thresholds, the volumes by which statistics and `when` are\n"
    "weighted, and the gradients of derived fields. A warning states that these gradients are those of the warped "
    "mesh.\n"
    ""
    "\n"
    "- The pictures are those of a mesh that the simulation gives with these coordinates, to the bit, for all kinds of "
    "meshes.\n"
    "- Vertices that are equal on two ranks or blocks remain equal if their displacements are equal.\n"
    "- The displacements are computed in steps that draw or write statistics. Vertices are moved again only if the "
    "mesh or the\n"
    "  field has changed, and then the trees are refitted.\n"
    "- Each mesh that a name stands for must have the field. A name that stands for no mesh causes a warning.\n"
    "\n"
    "**Memory.** Moved coordinates have the type of the given ones, which takes 12 or 24 bytes per vertex. For "
    "lattices with\n"
    "coordinates along axes they are float64. The report counts them as copied.\n"
    "\n"
    "## Mirrored meshes\n"
    "\n"
    "`mirror` draws a mesh together with its images in mirror planes, each of which is perpendicular to an axis. With "
    "1, 2 or\n"
    "3 planes the mesh is drawn 2, 4 or 8 times. So half, a quarter or an eighth of a symmetric body is drawn as a "
    "whole:\n"
    "\n"
    "```yaml\n"
    "meshes:\n"
    "  half: {mirror: x}              # in the plane x = 0\n"
    "  quarter: {mirror: [x, z]}      # in the planes x = 0 and z = 0\n"
    "  tank: {mirror: {y: 1.5}}       # in the plane y = 1.5\n"
    "images:\n"
    "  - name: whole\n"
    "    layers:\n"
    "      - surface: {colour_by: {field: stress}}\n"
    "    outputs: [{path: \"whole_{cycle:06}.png\"}]\n"
    "```\n"
    "\n"
    "Pictures are those of a mesh that consists of the given cells and their images, to the bit, on any partition. A\n"
    "coordinate x of an image is 2 * plane - x. All layers, edges, lights, clips, planes, the bounds of the data and "
    "automatic\n"
    "cameras include the images.\n"
    "\n"
    "- Vertices in a mirror plane belong to both sides. So no wall is drawn there, and values continue across the "
    "plane.\n"
    "  Such a vertex may differ from the plane by rounding: by at most 4 epsilons of the coordinates' type, multiplied "
    "by the\n"
    "  plane's coordinate, or for a uniform lattice by |origin| + |spacing * index|.\n"
    "- A warped mesh is mirrored after it has been warped.\n"
    "- An image has the colours of a picture in a mirror: a component of a vector keeps its sign.\n"
    "- Derived fields have the values of the given mesh. Their gradients do not use the cells of images.\n"
    "- Statistics, `when` and the counts of the report include only the given cells.\n"
    "- A mesh with cells on both sides of its mirror plane overlaps its image. A warning says so.\n"
    "\n"
    "**Memory.** Each image has coordinates of its own, of 12 or 24 bytes per vertex. If the given coordinates are "
    "packed in an\n"
    "array for each axis, an image only has 4 or 8 bytes for each axis along which it is mirrored. The report counts "
    "them as\n"
    "copied. Each image also has a tree of its own. All other arrays are the given ones.\n";

enum { MOST_MAPPINGS = 128 };
static const scene_mapping *shown[MOST_MAPPINGS];
static int shown_count;

/* Prints each mapping once, with its path in the scene file, in the order in which mappings appear on the page. */
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
        scene_describe_value(&mapping->fields[i].value, key, words);
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

static int compare_output(FILE *expected, const char *file_name)
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
    const int result = compare_output(page, arguments[1]);
    fclose(page);
    return result;
}
