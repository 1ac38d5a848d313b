/* The functions that Catalyst calls. catalyst_implementation() (catalyst_impl_insitu.h) defines the table of them. */
#include <catalyst_impl_insitu.h>

#include "catalyst_adaptor.h"
#include "insitu/conduit.h"

/* Converts errors of libinsitu to numbers above those that Catalyst uses itself. */
static enum catalyst_status convert_status(insitu_status status)
{
    return status ? (enum catalyst_status)(100 + (int)status) : catalyst_status_ok;
}

static void set_string(void *node, const char *path, const char *value)
{
    conduit_node_set_path_char8_str((conduit_node *)node, path, value);
}

static void set_integer(void *node, const char *path, int64_t value)
{
    conduit_node_set_path_int64((conduit_node *)node, path, value);
}

static void set_real(void *node, const char *path, double value)
{
    conduit_node_set_path_float64((conduit_node *)node, path, value);
}

static const catalyst_writer writer = {set_string, set_integer, set_real};

enum catalyst_status catalyst_initialize_insitu(const conduit_node *params)
{
    return convert_status(catalyst_adaptor_initialize(&insitu_conduit_functions, params));
}

enum catalyst_status catalyst_execute_insitu(const conduit_node *params)
{
    return convert_status(catalyst_adaptor_execute(params));
}

enum catalyst_status catalyst_finalize_insitu(const conduit_node *params)
{
    (void)params;
    return convert_status(catalyst_adaptor_finalize());
}

enum catalyst_status catalyst_about_insitu(conduit_node *params)
{
    catalyst_adaptor_write_about(&writer, params);
    return catalyst_status_ok;
}

enum catalyst_status catalyst_results_insitu(conduit_node *params)
{
    catalyst_adaptor_write_results(&writer, params);
    return catalyst_status_ok;
}
