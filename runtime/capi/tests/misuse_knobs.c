/* Every wrong use of decoders and surfaces that the header names, one line each: what was done, and the status that came
 * back.
 *
 *   misuse_knobs baked.sinew other.sinew compact.sinew
 *
 * `tests/c_programs.rs` runs this and compares the lines with `tests/misuse_knobs.txt`.
 */
#include "misuse.h"

static SinewDecoder *decoder;
static SinewSurface *surface;
static SinewLayout decoder_layout, surface_layout;

static SinewDecoderSettings decoder_settings(void)
{
    SinewDecoderSettings settings = SINEW_INIT(SinewDecoderSettings);
    return settings;
}

static SinewStatus open_decoder(const SinewDecoderSettings *settings, SinewDetails *more)
{
    SinewDecoder **out = (SinewDecoder **)(void *)block.outs;
    return sinew_decoder_open(SINEW_ABI_VERSION, settings, block.scratch, BLOCK_BYTES, out, more);
}

static void opening_decoders(void)
{
    SinewDecoder **out = (SinewDecoder **)(void *)block.outs;
    SinewDecoderSettings settings = decoder_settings();
    uint8_t *memory = block.scratch;
    size_t size = decoder_layout.size_bytes;
    say("decoder layout to NULL", sinew_decoder_layout(NULL));
    say("decoder layout to a misaligned place", sinew_decoder_layout((SinewLayout *)(void *)(block.outs + 1)));
    say_details("decoder with the header of another version",
                sinew_decoder_open(SINEW_ABI_VERSION + 1, NULL, memory, size, out, &details));
    say("decoder in NULL memory", sinew_decoder_open(SINEW_ABI_VERSION, NULL, NULL, size, out, NULL));
    say("decoder in misaligned memory", sinew_decoder_open(SINEW_ABI_VERSION, NULL, memory + 8, size, out, NULL));
    say("decoder with a NULL result", sinew_decoder_open(SINEW_ABI_VERSION, NULL, memory, size, NULL, NULL));
    say_numbers("decoder in short memory",
                sinew_decoder_open(SINEW_ABI_VERSION, NULL, memory, size - 1, out, &details), size, size - 1);
    say("decoder in memory of impossible length",
        sinew_decoder_open(SINEW_ABI_VERSION, NULL, memory, SIZE_MAX, out, NULL));
    say("decoder with the result in its memory",
        sinew_decoder_open(SINEW_ABI_VERSION, NULL, memory, size, (SinewDecoder **)(void *)(memory + 64), NULL));
    settings.struct_bytes = 3;
    say("decoder settings of a wrong size", open_decoder(&settings, NULL));
    settings = decoder_settings();
    settings.protocol = 6;
    say_details("decoder of an unknown protocol", open_decoder(&settings, &details));
    settings.protocol = -1;
    say_details("decoder of a negative protocol", open_decoder(&settings, &details));
    settings = decoder_settings();
    settings.full_scale = 65536;
    say_details("decoder of a full scale of more than 16 bits", open_decoder(&settings, &details));
    settings = decoder_settings();
    settings.midi_coding = 4;
    say_details("decoder of an unknown coding", open_decoder(&settings, &details));
    settings = decoder_settings();
    settings.midi_pairing = 3;
    say_details("decoder of an unknown pairing", open_decoder(&settings, &details));
}

static void feeding(void)
{
    const uint8_t *line = (const uint8_t *)"1|2|3\n";
    size_t *taken = (size_t *)(void *)block.outs;
    SinewReading *reading = (SinewReading *)(void *)block.structs;
    SinewCounters *counters = (SinewCounters *)(void *)block.structs;
    SinewDeviceInfo *device = (SinewDeviceInfo *)(void *)block.structs;
    char name[SINEW_KNOB_NAME_BYTES];
    SinewDecoder *moved = (SinewDecoder *)(void *)block.scratch;
    uint8_t *bytes = block.outs;
    say("feed NULL", sinew_decoder_feed(NULL, 0, line, 6, taken));
    say("feed NULL bytes", sinew_decoder_feed(decoder, 0, NULL, 6, taken));
    say("feed without a result", sinew_decoder_feed(decoder, 0, line, 6, NULL));
    say("feed bytes of impossible length", sinew_decoder_feed(decoder, 0, line, SIZE_MAX / 2 + 1, taken));
    say("feed a decoder its own memory", sinew_decoder_feed(decoder, 0, block.extra + 64, 64, taken));
    say("feed with the result in the decoder",
        sinew_decoder_feed(decoder, 0, line, 6, (size_t *)(void *)(block.extra + 64)));
    say("feed a workspace", sinew_decoder_feed((SinewDecoder *)(void *)workspace, 0, line, 6, taken));
    say("feed a NULL datagram", sinew_decoder_feed_packet(decoder, 0, NULL, 6));
    say("feed a datagram of impossible length", sinew_decoder_feed_packet(decoder, 0, line, SIZE_MAX / 2 + 1));
    memcpy(block.scratch, block.extra, decoder_layout.size_bytes);
    remember();
    say("feed a copied decoder", sinew_decoder_feed(moved, 0, line, 6, taken));
    block.extra[decoder_layout.size_bytes - 1] ^= 1;
    remember();
    say("feed a decoder written over its end", sinew_decoder_feed(decoder, 0, line, 6, taken));
    block.extra[decoder_layout.size_bytes - 1] ^= 1;
    remember();
    say("replug NULL", sinew_decoder_replugged(NULL));
    reading->struct_bytes = sizeof *reading;
    remember();
    say("next of NULL", sinew_decoder_next(NULL, reading));
    say("next to NULL", sinew_decoder_next(decoder, NULL));
    reading->struct_bytes = 1;
    remember();
    say("next to a reading of a wrong size", sinew_decoder_next(decoder, reading));
    say("counters to NULL", sinew_decoder_counters(decoder, 0, NULL));
    say("counters of a wrong size", sinew_decoder_counters(decoder, 0, counters));
    say("device to NULL", sinew_decoder_info(decoder, NULL));
    say("device of a wrong size", sinew_decoder_info(decoder, device));
    say("knob name to NULL", sinew_decoder_knob_name(decoder, 0, NULL, 33));
    say("knob name to no buffer", sinew_decoder_knob_name(decoder, 0, name, 0));
    say("knob name into the decoder", sinew_decoder_knob_name(decoder, 0, (char *)block.extra + 64, 33));
    say("knob name of no knob", sinew_decoder_knob_name(decoder, UINT32_MAX, name, 1));
    say("greeting to NULL", sinew_decoder_greeting(decoder, 0, NULL, SINEW_GREETING_BYTES, taken));
    say("greeting without a length", sinew_decoder_greeting(decoder, 0, bytes, SINEW_GREETING_BYTES, NULL));
    say("greeting to a short buffer", sinew_decoder_greeting(decoder, 0, bytes + 64, SINEW_GREETING_BYTES - 1, taken));
    say("greeting to no buffer", sinew_decoder_greeting(decoder, 0, NULL, 0, taken));
    say("greeting into the decoder", sinew_decoder_greeting(decoder, 0, block.extra + 64, SINEW_GREETING_BYTES, taken));
    must(sinew_decoder_greeting(decoder, 0, bytes + 64, SINEW_GREETING_BYTES, taken));
    printf("after all these it is still sent %lu bytes\n", (unsigned long)*taken);
    remember();
}

static SinewSurfaceSettings surface_settings(void)
{
    SinewSurfaceSettings settings = SINEW_INIT(SinewSurfaceSettings);
    settings.knob_count = 4;
    return settings;
}

static SinewStatus make_surface(const SinewSurfaceSettings *settings)
{
    SinewSurface **out = (SinewSurface **)(void *)block.outs;
    return sinew_surface_create(basis, settings, block.scratch, BLOCK_BYTES, out, &details);
}

static void creating_surfaces(void)
{
    SinewSurface **out = (SinewSurface **)(void *)block.outs;
    SinewSurfaceSettings settings = surface_settings();
    uint8_t *memory = block.scratch;
    size_t size = surface_layout.size_bytes;
    say("surface layout of NULL", sinew_surface_layout(NULL, &settings, (SinewLayout *)(void *)block.outs, NULL));
    say("surface layout without settings",
        sinew_surface_layout(basis, NULL, (SinewLayout *)(void *)block.outs, NULL));
    say("surface layout to NULL", sinew_surface_layout(basis, &settings, NULL, NULL));
    say("surface of NULL", sinew_surface_create(NULL, &settings, memory, size, out, NULL));
    say("surface in NULL memory", sinew_surface_create(basis, &settings, NULL, size, out, NULL));
    say("surface in misaligned memory", sinew_surface_create(basis, &settings, memory + 4, BLOCK_BYTES, out, NULL));
    say_numbers("surface in short memory", sinew_surface_create(basis, &settings, memory, size - 1, out, &details),
                size, size - 1);
    say("surface in the package", sinew_surface_create(basis, &settings, block.package, BLOCK_BYTES, out, NULL));
    say("surface over the basis", sinew_surface_create(basis, &settings, block.basis, BLOCK_BYTES, out, NULL));
    say("surface with a NULL result", sinew_surface_create(basis, &settings, memory, size, NULL, NULL));
    settings.struct_bytes = 0;
    say("surface settings of size 0", make_surface(&settings));
    settings = surface_settings();
    settings.knob_count = SINEW_KNOBS_MAX + 1;
    say_details("surface of too many knobs", make_surface(&settings));
    settings = surface_settings();
    settings.binding_count = SINEW_BINDINGS_MAX + 1;
    say_details("surface of too many bindings", make_surface(&settings));
    settings = surface_settings();
    settings.knob_count = 0;
    say_details("surface without knobs", make_surface(&settings));
    settings = surface_settings();
    settings.tree_fine = 2;
    say_details("surface whose tree has no coarse knob", make_surface(&settings));
    settings.tree_coarse = 3;
    say_details("surface whose tree has more knobs than there are", make_surface(&settings));
    settings.tree_coarse = 65536;
    say_details("surface whose tree has more knobs than count", make_surface(&settings));
    settings = surface_settings();
    settings.tree_takeover = 4;
    say_details("surface with an unknown takeover", make_surface(&settings));
}

static void mapping(void)
{
    SinewSurfaceSettings settings = surface_settings();
    SinewKnob knobs[4];
    SinewBinding bindings[2];
    int n;
    memset(knobs, 0, sizeof knobs);
    memset(bindings, 0, sizeof bindings);
    for (n = 0; n < 4; n++) {
        knobs[n].address = (uint32_t)n;
    }
    bindings[0].page = SINEW_NONE;
    bindings[1].control = 1;
    bindings[1].page = 1;
    settings.knobs = knobs;
    settings.knob_bytes = sizeof knobs[0];
    settings.bindings = bindings;
    settings.binding_count = 2;
    settings.binding_bytes = sizeof bindings[0];
    say("surface with bindings", make_surface(&settings));

    settings.knob_bytes = 0;
    say_details("surface with knobs of no size", make_surface(&settings));
    settings.knob_bytes = sizeof knobs[0];
    settings.bindings = NULL;
    say_details("surface with NULL bindings", make_surface(&settings));
    settings.bindings = bindings;
    settings.binding_bytes = 4;
    say_details("surface with bindings of a wrong size", make_surface(&settings));
    settings.binding_bytes = sizeof bindings;
    settings.binding_count = 1;
    say_details("surface with a binding of the future", make_surface(&settings));
    settings.binding_bytes = sizeof bindings[0];
    settings.binding_count = 2;

    knobs[3].address = 1;
    say_details("surface with one address for two knobs", make_surface(&settings));
    knobs[3].address = 65536;
    say_details("surface with an address beyond 16 bits", make_surface(&settings));
    knobs[3].address = 3;
    knobs[2].full_scale = 1023;
    say_details("surface with a calibration without range", make_surface(&settings));
    knobs[2].highest = 65536;
    say_details("surface with a calibration beyond 16 bits", make_surface(&settings));
    knobs[2].full_scale = 0;
    knobs[1].step = 1.5f;
    say_details("surface with a step beyond the travel", make_surface(&settings));
    knobs[1].step = NAN;
    say_details("surface with a step that is no number", make_surface(&settings));
    knobs[1].step = 0.0f;

    bindings[1].knob = 4;
    say_details("binding of a knob beyond the last", make_surface(&settings));
    bindings[1].knob = 70000;
    say_details("binding of a knob beyond 16 bits", make_surface(&settings));
    bindings[1].knob = 1;
    bindings[1].control = info.control_count;
    say_details("binding of a control beyond the last", make_surface(&settings));
    bindings[1].control = 70000;
    say_details("binding of a control beyond 16 bits", make_surface(&settings));
    bindings[1].control = 0;
    say_details("two bindings of one control", make_surface(&settings));
    bindings[1].control = 1;
    bindings[1].page = 70000;
    say_details("binding on a page beyond 16 bits", make_surface(&settings));
    bindings[1].page = 1;
    bindings[1].takeover = 9;
    say_details("binding with an unknown takeover", make_surface(&settings));
    bindings[1].takeover = 0;
    bindings[1].curve = 4;
    say_details("binding with an unknown curve", make_surface(&settings));
    bindings[1].curve = SINEW_CURVE_EXPONENTIAL;
    say_details("binding with a curve without its number", make_surface(&settings));
    bindings[1].curve = 0;
    bindings[1].centre = 3;
    say_details("binding with an unknown centre", make_surface(&settings));
    bindings[1].centre = SINEW_CENTRE_REST;
    bindings[1].detent = 0.75f;
    say_details("binding with a detent beyond half of the travel", make_surface(&settings));
    bindings[1].centre = 0;
    bindings[1].slew = -1.0f;
    say_details("binding with a negative slew limit", make_surface(&settings));
    bindings[1].slew = NAN;
    say_details("binding with a slew limit that is no number", make_surface(&settings));
    bindings[1].slew = 0.0f;
    bindings[1].maximum = 1e9f;
    say_details("binding wider than its control", make_surface(&settings));
    bindings[1].maximum = 0.0f;
    settings.tree_coarse = 1;
    say_details("binding of a knob that follows the tree", make_surface(&settings));
}

static void performing(void)
{
    SinewReading reading = SINEW_INIT(SinewReading);
    SinewSurfaceStatus *status = (SinewSurfaceStatus *)(void *)block.structs;
    SinewKnobState *state = (SinewKnobState *)(void *)block.structs;
    say_details("advance NULL", sinew_surface_advance(NULL, controls, 0, &details));
    say("advance NULL controls", sinew_surface_advance(surface, NULL, 0, NULL));
    say_details("advance another basis's controls", sinew_surface_advance(surface, other_controls, 0, &details));
    say("advance a decoder", sinew_surface_advance((SinewSurface *)(void *)decoder, controls, 0, NULL));
    details.struct_bytes = 1;
    say("advance with details of a wrong size", sinew_surface_advance(surface, controls, 0, &details));
    say("read NULL", sinew_surface_read(surface, NULL));
    say("read with NULL", sinew_surface_read(NULL, &reading));
    say("read nothing", sinew_surface_read(surface, &reading));
    reading.kind = 7;
    say("read an unknown kind", sinew_surface_read(surface, &reading));
    reading.kind = SINEW_READING_KIND_POSITION;
    say("read a position without scale", sinew_surface_read(surface, &reading));
    reading.full_scale = 1023;
    reading.value = 1024;
    say("read a position above its scale", sinew_surface_read(surface, &reading));
    reading.value = -1;
    say("read a position below zero", sinew_surface_read(surface, &reading));
    reading.value = 1;
    reading.knob = 65536;
    say("read a knob beyond 16 bits", sinew_surface_read(surface, &reading));
    reading.kind = SINEW_READING_KIND_STEPS;
    reading.knob = 0;
    reading.value = 40000;
    say("read more steps than fit", sinew_surface_read(surface, &reading));
    reading.struct_bytes = 2;
    say("read a reading of a wrong size", sinew_surface_read(surface, &reading));
    say("unplug NULL", sinew_surface_unplugged(NULL, 0));
    say("replug NULL", sinew_surface_replugged(NULL, 0));
    say("no command", sinew_surface_command(surface, 0, 0));
    say("an unknown command", sinew_surface_command(surface, 10, 0));
    say("a command to NULL", sinew_surface_command(NULL, SINEW_COMMAND_STOP, 0));
    say("focus on a control beyond the last", sinew_surface_command(surface, SINEW_COMMAND_FOCUS, info.control_count));
    say("focus on a control beyond 16 bits", sinew_surface_command(surface, SINEW_COMMAND_FOCUS, 65536));
    say("a page beyond the last", sinew_surface_command(surface, SINEW_COMMAND_PAGE, 1));
    say("a page beyond 16 bits", sinew_surface_command(surface, SINEW_COMMAND_PAGE, 65536));
    say("state of a knob beyond the last", (state->struct_bytes = sizeof *state, remember(),
                                            sinew_surface_knob(surface, 4, state)));
    say("state to NULL", sinew_surface_knob(surface, 0, NULL));
    say("state of NULL", sinew_surface_knob(NULL, 0, state));
    memcpy(block.scratch, block.package, sizeof(size_t));
    ((SinewKnobState *)(void *)block.package)->struct_bytes = sizeof *state;
    remember();
    say("state into the package", sinew_surface_knob(surface, 0, (SinewKnobState *)(void *)block.package));
    memcpy(block.package, block.scratch, sizeof(size_t));
    status->struct_bytes = 1;
    remember();
    say("status of a wrong size", sinew_surface_status(surface, status));
    say("status to NULL", sinew_surface_status(surface, NULL));
}

static void closing(void)
{
    size_t *taken = (size_t *)(void *)block.outs;
    must(sinew_close(decoder));
    must(sinew_close(surface));
    remember();
    say("feed a closed decoder", sinew_decoder_feed(decoder, 0, block.outs + 64, 1, taken));
    say("advance a closed surface", sinew_surface_advance(surface, controls, 0, NULL));
    say("close a decoder twice", sinew_close(decoder));
    say("close a surface twice", sinew_close(surface));
}

int main(int argc, char **argv)
{
    SinewSurfaceSettings settings;
    SinewDecoderSettings firmata;
    prepare(argc, argv);
    must(sinew_decoder_layout(&decoder_layout));
    firmata = decoder_settings();
    firmata.protocol = SINEW_PROTOCOL_FIRMATA;
    must(sinew_decoder_open(SINEW_ABI_VERSION, &firmata, block.extra, BLOCK_BYTES, &decoder, NULL));
    settings = surface_settings();
    must(sinew_surface_layout(basis, &settings, &surface_layout, NULL));
    must(sinew_surface_create(basis, &settings, block.other_workspace, BLOCK_BYTES, &surface, NULL));
    remember();
    opening_decoders();
    feeding();
    creating_surfaces();
    mapping();
    performing();
    closing();
    return finish();
}
