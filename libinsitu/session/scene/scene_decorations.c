/* Reads the keys of an image's decorations: titles, colour bars, rulers and other texts and lines drawn in addition to
 * the data. */
#include <stdio.h>
#include <string.h>

#include "colour_map.h"
#include "memory.h"
#include "scene_convert.h"

static insitu_status check_and_copy_text(const scene_document *d, const char *path, const char *key, const char *text,
                                         char **out)
{
    const insitu_status status = scene_check_placeholders(d, path, key, text);
    if (status) return status;
    *out = base_strdup(text);
    return *out ? INSITU_OK : scene_fail_for_memory(d);
}

static insitu_status convert_text_decorations(const scene_document *d, const char *path,
                                              const scene_file_decorations *in, scene_decorations *out)
{
    insitu_status status = INSITU_OK;
    out->words = base_calloc((size_t)in->text_count, sizeof *out->words);
    if (!out->words) return scene_fail_for_memory(d);
    for (int i = 0; i < in->text_count && !status; i++) {
        char words_path[SCENE_PATH_SIZE];
        snprintf(words_path, sizeof words_path, "%s.text[%d]", path, i);
        out->words_count++;
        out->words[i].anchor = in->text[i].at ? (scene_anchor)*in->text[i].at : SCENE_TOP_LEFT;
        status = check_and_copy_text(d, words_path, "text", in->text[i].text, &out->words[i].text);
    }
    return status;
}

static insitu_status convert_colour_bar_settings(const scene_document *d, const char *path,
                                                 const scene_file_colour_bar *in, scene_decorations *out)
{
    char labels_path[SCENE_PATH_SIZE + 8], units_path[SCENE_PATH_SIZE + 8];
    snprintf(labels_path, sizeof labels_path, "%s.colour_bar.labels", path);
    snprintf(units_path, sizeof units_path, "%s.colour_bar.units", path);
    out->has_bars = in != NULL;
    out->bar_anchor = in && in->at ? (scene_anchor)*in->at : SCENE_RIGHT;
    out->tick_count = in && in->ticks ? *in->ticks : 6;
    out->number_form.notation = in && in->notation ? (scene_notation)*in->notation : SCENE_SHORTEST;
    out->number_form.has_digits = in && in->digits;
    out->number_form.digits = out->number_form.has_digits ? *in->digits : 0;
    const insitu_status status = scene_copy_texts(d, in ? labels_path : NULL, &out->labels, &out->label_count);
    return status ? status : scene_copy_texts(d, in ? units_path : NULL, &out->units, &out->unit_count);
}

insitu_status scene_convert_decorations(const scene_document *d, const char *path, const scene_file_decorations *in,
                                        scene_decorations *out)
{
    if (!in) return INSITU_OK;
    out->is_given = true;
    out->outline = in->outline ? (scene_boxes)*in->outline : SCENE_NO_BOX;
    out->has_axes = in->axes && *in->axes;
    out->has_rulers = in->rulers && *in->rulers;
    out->has_scale_bar = in->scale_bar != NULL;
    out->scale_bar_anchor = in->scale_bar && in->scale_bar->at ? (scene_anchor)*in->scale_bar->at : SCENE_BOTTOM_RIGHT;
    out->scale_unit = in->scale_bar && in->scale_bar->unit ? base_strdup(in->scale_bar->unit) : NULL;
    if (in->scale_bar && in->scale_bar->unit && !out->scale_unit) return scene_fail_for_memory(d);
    out->has_colour = in->colour != NULL;
    for (int i = 0; in->colour && i < 3; i++) out->colour[i] = colour_linear_from_srgb((float)in->colour[i]);
    out->size = in->size ? *in->size : 0.03;
    insitu_status status = in->title ? check_and_copy_text(d, path, "title", in->title, &out->title) : INSITU_OK;
    if (!status) status = convert_text_decorations(d, path, in, out);
    return status ? status : convert_colour_bar_settings(d, path, in->colour_bar, out);
}

void scene_free_decorations(scene_decorations *decorations)
{
    for (int i = 0; i < decorations->words_count; i++) base_free(decorations->words[i].text);
    for (int i = 0; i < decorations->label_count; i++) base_free(decorations->labels[i]);
    base_free(decorations->words);
    for (int i = 0; i < decorations->unit_count; i++) base_free(decorations->units[i]);
    base_free(decorations->labels);
    base_free(decorations->units);
    base_free(decorations->title);
    base_free(decorations->scale_unit);
}
