/* Bytes of a knob box move a mesh: what a program does with a serial port of its own.
 *
 *   knobs package.sinew bytes pose.obj [knobs]
 *
 * `bytes` is a recording, or a port that was set up before (stty -F /dev/ttyUSB0 9600 raw); a read stands for what the port
 * gave in one frame. What the box speaks is found out. Its knobs, 8 unless told, follow the tree of components. At the end the
 * state of every knob is printed and the pose written.
 */
#include "example.h"
#include "sinew_knobs.h"

enum { BYTES_A_FRAME = 64, FRAME_US = 16667 };

/* Hands what the port gave to the decoder, what that says to the surface, and what the box waits for to the port. */
static void pump(SinewDecoder *decoder, SinewSurface *surface, FILE *port, uint64_t now_us, const uint8_t *bytes, size_t length)
{
    uint8_t greeting[SINEW_GREETING_BYTES];
    size_t done = 0, greeting_bytes;
    do {
        SinewReading reading = SINEW_INIT(SinewReading);
        size_t taken;
        check("feed", sinew_decoder_feed(decoder, now_us, bytes + done, length - done, &taken), NULL);
        done += taken;
        for (;;) {
            check("next", sinew_decoder_next(decoder, &reading), NULL);
            if (reading.kind == SINEW_READING_KIND_NONE) {
                break;
            }
            check("read", sinew_surface_read(surface, &reading), NULL);
        }
    } while (done < length);
    check("greeting", sinew_decoder_greeting(decoder, now_us, greeting, sizeof greeting, &greeting_bytes), NULL);
    if (port != NULL && greeting_bytes > 0) {
        fwrite(greeting, 1, greeting_bytes, port);
        fflush(port);
    }
}

static void print_knob(const SinewBasis *basis, const SinewDecoder *decoder, const SinewSurface *surface, uint32_t knob)
{
    char name[SINEW_KNOB_NAME_BYTES], control[SINEW_NAME_BYTES] = "nothing";
    SinewKnobState state = SINEW_INIT(SinewKnobState);
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
    SinewDeviceInfo device = SINEW_INIT(SinewDeviceInfo);
    SinewCounters counters = SINEW_INIT(SinewCounters);
    check("device", sinew_decoder_info(decoder, &device), NULL);
    check("counters", sinew_decoder_counters(decoder, now_us, &counters), NULL);
    printf("%s; %lu bytes, %lu good, %lu bad", device.text, (unsigned long)counters.bytes, (unsigned long)counters.good,
           (unsigned long)counters.bad);
    if (counters.last_fault != 0) {
        printf(" (%s)", counters.last_fault_text);
    }
    printf("\n");
}

int main(int argc, char **argv)
{
    SinewDetails details = SINEW_INIT(SinewDetails);
    SinewPlayer player = SINEW_INIT(SinewPlayer);
    SinewFrameOptions frame = SINEW_INIT(SinewFrameOptions);
    SinewSurfaceSettings settings = SINEW_INIT(SinewSurfaceSettings);
    SinewLayout layout;
    SinewDecoder *decoder;
    SinewSurface *surface;
    void *starts[5], *package, *memory;
    uint8_t bytes[BYTES_A_FRAME];
    size_t length, floats;
    uint64_t now_us = 0;
    uint32_t knob;
    FILE *file, *port;
    int n;

    if (argc < 4) {
        fail("usage", "knobs package.sinew bytes pose.obj [knobs]");
    }
    package = read_file(argv[1], &length, &starts[0]);
    check(argv[1], sinew_player_layout(package, length, NULL, &layout, &details), &details);
    memory = allocate(layout.size_bytes, &starts[1]);
    check(argv[1], sinew_player_open(SINEW_ABI_VERSION, package, length, NULL, memory, layout.size_bytes, &player, &details),
          &details);

    check("layout", sinew_decoder_layout(&layout), NULL);
    memory = allocate(layout.size_bytes, &starts[2]);
    check("decoder", sinew_decoder_open(SINEW_ABI_VERSION, NULL, memory, layout.size_bytes, &decoder, &details), &details);
    settings.knob_count = argc > 4 ? (size_t)strtoul(argv[4], NULL, 10) : 8;
    check("knobs", sinew_surface_layout(player.basis, &settings, &layout, &details), &details);
    memory = allocate(layout.size_bytes, &starts[3]);
    check("knobs", sinew_surface_create(player.basis, &settings, memory, layout.size_bytes, &surface, &details), &details);

    floats = 3 * (size_t)player.vertex_count;
    frame.positions = (float *)allocate(floats * sizeof(float), &starts[4]);
    frame.position_floats = floats;
    file = open_file(argv[2], "rb");
    port = strncmp(argv[2], "/dev/", 5) == 0 ? open_file(argv[2], "wb") : NULL;
    do {
        length = fread(bytes, 1, sizeof bytes, file);
        pump(decoder, surface, port, now_us, bytes, length);
        check("advance", sinew_surface_advance(surface, player.controls, now_us, &details), &details);
        check("frame", sinew_frame(player.basis, player.workspace, player.controls, &frame, NULL, &details), &details);
        now_us += FRAME_US;
    } while (length > 0);
    fclose(file);
    if (port != NULL) {
        fclose(port);
    }

    print_device(decoder, now_us);
    for (knob = 0; knob < settings.knob_count; knob++) {
        print_knob(player.basis, decoder, surface, knob);
    }
    write_obj(argv[3], player.basis, frame.positions, NULL, 1);
    for (n = 0; n < 5; n++) {
        free(starts[n]);
    }
    return EXIT_SUCCESS;
}
