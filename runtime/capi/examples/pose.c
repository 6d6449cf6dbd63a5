/* Plays one pose of a package and writes it as an OBJ.
 *
 *   pose package.sinew pose.obj [control=weight ...]
 *
 * Without controls given, the first two stand halfway to their upper stops. Build: see include/sinew.h.
 */
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sinew.h"

/* Memory at a multiple of a power of two, from plain malloc. `start` is what to free. */
typedef struct {
    void *start;
    uint8_t *memory;
} Block;

static void fail(const char *what, const char *why)
{
    fprintf(stderr, "pose: %s: %s\n", what, why);
    exit(EXIT_FAILURE);
}

static void check(const char *what, SinewStatus status, const SinewDetails *details)
{
    if (status != SINEW_STATUS_OK) {
        fail(what, details != NULL ? details->text : sinew_status_text(status));
    }
}

static Block allocate(size_t size_bytes, size_t alignment)
{
    Block block;
    block.start = malloc(size_bytes + alignment);
    if (block.start == NULL) {
        fail("memory", "none left");
    }
    block.memory = (uint8_t *)(((uintptr_t)block.start + alignment - 1) & ~(uintptr_t)(alignment - 1));
    return block;
}

static Block read_file(const char *path, size_t *length)
{
    FILE *file = fopen(path, "rb");
    long end;
    Block block;
    if (file == NULL || fseek(file, 0, SEEK_END) != 0 || (end = ftell(file)) < 0) {
        fail(path, strerror(errno));
    }
    rewind(file);
    *length = (size_t)end;
    block = allocate(*length, 16);
    if (fread(block.memory, 1, *length, file) != *length) {
        fail(path, "cannot be read to its end");
    }
    fclose(file);
    return block;
}

/* "name=weight", clamped to the control's range. */
static void set_named(const SinewBasis *basis, SinewControls *controls, const char *argument)
{
    char name[SINEW_NAME_BYTES];
    const char *equals = strchr(argument, '=');
    char *end;
    uint32_t control;
    float weight;
    if (equals == NULL || (size_t)(equals - argument) >= sizeof name) {
        fail(argument, "should be control=weight");
    }
    memcpy(name, argument, (size_t)(equals - argument));
    name[equals - argument] = '\0';
    weight = (float)strtod(equals + 1, &end);
    if (end == equals + 1 || *end != '\0') {
        fail(argument, "the weight is not a number");
    }
    check(name, sinew_control_find(basis, name, &control), NULL);
    check(argument, sinew_control_set(controls, control, weight, NULL), NULL);
}

static void set_halfway(const SinewBasis *basis, SinewControls *controls, uint32_t control)
{
    float maximum;
    check("range", sinew_control_range(basis, control, NULL, &maximum), NULL);
    check("set", sinew_control_set(controls, control, 0.5f * maximum, NULL), NULL);
}

static void print_controls(const SinewBasis *basis, const SinewControls *controls, uint32_t control_count)
{
    uint32_t control;
    for (control = 0; control < control_count; control++) {
        char name[SINEW_NAME_BYTES];
        float weight, minimum, maximum;
        uint32_t level;
        check("name", sinew_control_name(basis, control, name, sizeof name), NULL);
        check("range", sinew_control_range(basis, control, &minimum, &maximum), NULL);
        check("parent", sinew_control_parent(basis, control, NULL, &level), NULL);
        check("get", sinew_control_get(controls, control, &weight), NULL);
        printf("%*s%s = %g (%g to %g)\n", (int)(2 * level), "", name, weight, minimum, maximum);
    }
}

static void write_obj(const char *path, const SinewBasis *basis, const float *positions, const float *normals,
                      uint32_t vertex_count)
{
    const uint32_t *indices;
    size_t index_count, at;
    uint32_t vertex;
    FILE *file = fopen(path, "w");
    if (file == NULL) {
        fail(path, strerror(errno));
    }
    check("faces", sinew_basis_faces(basis, &indices, &index_count), NULL);
    for (vertex = 0; vertex < vertex_count; vertex++) {
        const float *x = positions + 3 * vertex;
        fprintf(file, "v %.9g %.9g %.9g\n", x[0], x[1], x[2]);
    }
    for (vertex = 0; vertex < vertex_count; vertex++) {
        const float *n = normals + 3 * vertex;
        fprintf(file, "vn %.9g %.9g %.9g\n", n[0], n[1], n[2]);
    }
    for (at = 0; at < index_count; at += 3) {
        /* OBJ counts from one. */
        unsigned long a = indices[at] + 1ul, b = indices[at + 1] + 1ul, c = indices[at + 2] + 1ul;
        fprintf(file, "f %lu//%lu %lu//%lu %lu//%lu\n", a, a, b, b, c, c);
    }
    if (fclose(file) != 0) {
        fail(path, "cannot be written to its end");
    }
}

int main(int argc, char **argv)
{
    SinewDetails details;
    SinewLayout layout;
    SinewBasisInfo info;
    SinewFrameOptions options;
    SinewBasis *basis = NULL;
    SinewWorkspace *workspace = NULL;
    SinewControls *controls = NULL;
    Block package, basis_block, workspace_block, controls_block, positions, normals;
    size_t length, floats;
    int argument;

    if (argc < 3) {
        fail("usage", "pose package.sinew pose.obj [control=weight ...]");
    }
    details.struct_bytes = sizeof details;
    info.struct_bytes = sizeof info;

    package = read_file(argv[1], &length);
    check("layout", sinew_basis_layout(&layout), NULL);
    basis_block = allocate(layout.size_bytes, layout.alignment);
    check(argv[1], sinew_basis_open(SINEW_ABI_VERSION, package.memory, length, basis_block.memory, layout.size_bytes,
                                    &basis, &details), &details);
    check("info", sinew_basis_info(basis, &info), NULL);

    check("layout", sinew_workspace_layout(basis, &layout), NULL);
    workspace_block = allocate(layout.size_bytes, layout.alignment);
    check("workspace", sinew_workspace_create(basis, workspace_block.memory, layout.size_bytes, &workspace, &details),
          &details);

    check("layout", sinew_controls_layout(basis, &layout), NULL);
    controls_block = allocate(layout.size_bytes, layout.alignment);
    check("controls", sinew_controls_create(basis, controls_block.memory, layout.size_bytes, &controls, &details),
          &details);

    for (argument = 3; argument < argc; argument++) {
        set_named(basis, controls, argv[argument]);
    }
    if (argc == 3) {
        uint32_t control;
        for (control = 0; control < 2 && control < info.control_count; control++) {
            set_halfway(basis, controls, control);
        }
    }
    print_controls(basis, controls, info.control_count);

    floats = 3 * (size_t)info.vertex_count;
    positions = allocate(floats * sizeof(float), 16);
    normals = allocate(floats * sizeof(float), 16);
    memset(&options, 0, sizeof options);
    options.struct_bytes = sizeof options;
    options.positions = (float *)(void *)positions.memory;
    options.position_floats = floats;
    options.normals = (float *)(void *)normals.memory;
    options.normal_floats = floats;
    check("frame", sinew_frame(basis, workspace, controls, &options, NULL, &details), &details);
    write_obj(argv[2], basis, options.positions, options.normals, info.vertex_count);

    free(normals.start);
    free(positions.start);
    free(controls_block.start);
    free(workspace_block.start);
    free(basis_block.start);
    free(package.start);
    return EXIT_SUCCESS;
}
