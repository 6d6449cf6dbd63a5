/* Bytes of a knob box move a mesh: what a program does with a serial port of its own.
 *
 *   knobs package.sinew bytes pose.obj [knobs]
 *
 * `bytes` is a recording, or a port that was set up before (stty -F /dev/ttyUSB0 9600 raw); a read stands for what the port
 * gave in one frame. What the box speaks is found out. Its knobs, 8 unless told, follow the tree of components. At the end the
 * state of every knob is printed and the pose written. Build: see include/sinew.h.
 */
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sinew.h"

enum { BYTES_A_FRAME = 64, FRAME_US = 16667 };

static void fail(const char *what, const char *why)
{
    fprintf(stderr, "knobs: %s: %s\n", what, why);
    exit(EXIT_FAILURE);
}

static void check(const char *what, SinewStatus status, const SinewDetails *details)
{
    if (status != SINEW_STATUS_OK) {
        fail(what, details != NULL ? details->text : sinew_status_text(status));
    }
}

/* Memory at a multiple of 64 bytes, which is enough for every handle and package. `*start` is what to free. */
static uint8_t *allocate(size_t size_bytes, void **start)
{
    *start = malloc(size_bytes + 64);
    if (*start == NULL) {
        fail("memory", "none left");
    }
    return (uint8_t *)(((uintptr_t)*start + 63) & ~(uintptr_t)63);
}

static FILE *open_file(const char *path, const char *mode)
{
    FILE *file = fopen(path, mode);
    if (file == NULL) {
        fail(path, strerror(errno));
    }
    return file;
}

/* Hands what the port gave to the decoder, and what that says to the surface. */
static void pump(SinewDecoder *decoder, SinewSurface *surface, uint64_t now_us, const uint8_t *bytes, size_t length)
{
    size_t done = 0;
    do {
        SinewReading reading;
        size_t taken;
        check("feed", sinew_decoder_feed(decoder, now_us, bytes + done, length - done, &taken), NULL);
        done += taken;
        reading.struct_bytes = sizeof reading;
        for (;;) {
            check("next", sinew_decoder_next(decoder, &reading), NULL);
            if (reading.kind == SINEW_READING_KIND_NONE) {
                break;
            }
            check("take", sinew_surface_take(surface, now_us, &reading), NULL);
        }
    } while (done < length);
}

static void print_knob(const SinewBasis *basis, const SinewDecoder *decoder, const SinewSurface *surface, uint32_t knob)
{
    char name[SINEW_KNOB_NAME_BYTES], control[SINEW_NAME_BYTES] = "nothing";
    SinewKnobState state;
    state.struct_bytes = sizeof state;
    check("knob", sinew_surface_knob(surface, knob, &state), NULL);
    check("name", sinew_decoder_knob_name(decoder, knob, name, sizeof name), NULL);
    if (state.control != SINEW_NONE) {
        check("name", sinew_control_name(basis, state.control, control, sizeof control), NULL);
    }
    printf("knob %lu %s moves %s", (unsigned long)knob, name, control);
    switch (state.state) {
    case SINEW_TAKEOVER_STATE_TURN_LEFT:
        printf(", turn left %.0f %% to pick up", 100.0 * state.distance);
        break;
    case SINEW_TAKEOVER_STATE_TURN_RIGHT:
        printf(", turn right %.0f %% to pick up", 100.0 * state.distance);
        break;
    case SINEW_TAKEOVER_STATE_UNHEARD:
        printf(", not heard of");
        break;
    case SINEW_TAKEOVER_STATE_HELD:
        printf(", held");
        break;
    default:
        break;
    }
    printf("\n");
}

static void print_device(const SinewDecoder *decoder, uint64_t now_us)
{
    SinewDeviceInfo device;
    SinewCounters counters;
    device.struct_bytes = sizeof device;
    counters.struct_bytes = sizeof counters;
    check("device", sinew_decoder_info(decoder, &device), NULL);
    check("counters", sinew_decoder_counters(decoder, now_us, &counters), NULL);
    printf("%s; %lu bytes, %lu good, %lu bad", device.text, (unsigned long)counters.bytes, (unsigned long)counters.good,
           (unsigned long)counters.bad);
    if (counters.last_fault != 0) {
        printf(" (%s)", counters.last_fault_text);
    }
    printf("\n");
}

static void write_obj(const char *path, const SinewBasis *basis, const float *positions, uint32_t vertex_count)
{
    const uint32_t *indices;
    size_t index_count, at;
    uint32_t vertex;
    FILE *file = open_file(path, "w");
    check("faces", sinew_basis_faces(basis, &indices, &index_count), NULL);
    for (vertex = 0; vertex < vertex_count; vertex++) {
        const float *x = positions + 3 * vertex;
        fprintf(file, "v %.9g %.9g %.9g\n", x[0], x[1], x[2]);
    }
    for (at = 0; at < index_count; at += 3) {
        fprintf(file, "f %lu %lu %lu\n", indices[at] + 1ul, indices[at + 1] + 1ul, indices[at + 2] + 1ul);
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
    SinewSurfaceSettings settings;
    SinewBasis *basis;
    SinewWorkspace *workspace;
    SinewControls *controls;
    SinewDecoder *decoder;
    SinewSurface *surface;
    void *starts[7];
    uint8_t *memory, bytes[BYTES_A_FRAME];
    size_t length, floats;
    uint64_t now_us = 0;
    uint32_t knob;
    FILE *file;
    int n;

    if (argc < 4) {
        fail("usage", "knobs package.sinew bytes pose.obj [knobs]");
    }
    details.struct_bytes = sizeof details;
    info.struct_bytes = sizeof info;

    file = open_file(argv[1], "rb");
    if (fseek(file, 0, SEEK_END) != 0 || ftell(file) < 0) {
        fail(argv[1], strerror(errno));
    }
    length = (size_t)ftell(file);
    rewind(file);
    memory = allocate(length, &starts[0]);
    if (fread(memory, 1, length, file) != length) {
        fail(argv[1], "cannot be read to its end");
    }
    fclose(file);
    check("layout", sinew_basis_layout(&layout), NULL);
    check(argv[1], sinew_basis_open(SINEW_ABI_VERSION, memory, length, allocate(layout.size_bytes, &starts[1]),
                                    layout.size_bytes, &basis, &details), &details);
    check("info", sinew_basis_info(basis, &info), NULL);
    check("layout", sinew_workspace_layout(basis, &layout), NULL);
    check("workspace", sinew_workspace_create(basis, allocate(layout.size_bytes, &starts[2]), layout.size_bytes,
                                              &workspace, &details), &details);
    check("layout", sinew_controls_layout(basis, &layout), NULL);
    check("controls", sinew_controls_create(basis, allocate(layout.size_bytes, &starts[3]), layout.size_bytes, &controls,
                                            &details), &details);

    check("layout", sinew_decoder_layout(&layout), NULL);
    check("decoder", sinew_decoder_open(SINEW_ABI_VERSION, NULL, allocate(layout.size_bytes, &starts[4]),
                                        layout.size_bytes, &decoder, &details), &details);
    memset(&settings, 0, sizeof settings);
    settings.struct_bytes = sizeof settings;
    settings.knob_count = argc > 4 ? (size_t)strtoul(argv[4], NULL, 10) : 8;
    check("knobs", sinew_surface_layout(basis, &settings, &layout, &details), &details);
    check("knobs", sinew_surface_create(basis, &settings, allocate(layout.size_bytes, &starts[5]), layout.size_bytes,
                                        &surface, &details), &details);

    floats = 3 * (size_t)info.vertex_count;
    memset(&options, 0, sizeof options);
    options.struct_bytes = sizeof options;
    options.positions = (float *)(void *)allocate(floats * sizeof(float), &starts[6]);
    options.position_floats = floats;

    file = open_file(argv[2], "rb");
    do {
        length = fread(bytes, 1, sizeof bytes, file);
        pump(decoder, surface, now_us, bytes, length);
        check("advance", sinew_surface_advance(surface, controls, now_us, &details), &details);
        check("frame", sinew_frame(basis, workspace, controls, &options, NULL, &details), &details);
        now_us += FRAME_US;
    } while (length > 0);
    fclose(file);

    print_device(decoder, now_us);
    for (knob = 0; knob < settings.knob_count; knob++) {
        print_knob(basis, decoder, surface, knob);
    }
    write_obj(argv[3], basis, options.positions, info.vertex_count);
    for (n = 0; n < 7; n++) {
        free(starts[n]);
    }
    return EXIT_SUCCESS;
}
