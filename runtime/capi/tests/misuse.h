/* What the programs of wrong uses share: one arena for all memory, handles of two basises, and lines that say what a call
 * returned and whether it changed anything. After each refusal all memory that the call was given must be as before; a
 * change is printed and fails the program.
 */
#ifndef MISUSE_H
#define MISUSE_H

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sinew_batch.h"
#include "sinew_bones.h"
#include "sinew_knobs.h"
#include "sinew_pins.h"

/* All memory of the program is one arena, so that one copy of it shows what a refused call changed. */
enum { BLOCK_COUNT = 16, BLOCK_BYTES = 1 << 16, ARENA_BYTES = BLOCK_COUNT * BLOCK_BYTES };
static uint8_t *arena, *before;
static void *allocated;

typedef struct {
    uint8_t *package, *other, *compact, *scratch, *basis, *other_basis, *workspace, *other_workspace, *controls,
        *other_controls, *positions, *normals, *structs, *outs, *extra;
} Blocks;
static Blocks block;
static size_t package_bytes, other_bytes, compact_bytes;

static SinewBasis *basis, *other_basis;
static SinewWorkspace *workspace, *other_workspace;
static SinewControls *controls, *other_controls;
static SinewLayout basis_layout, workspace_layout, controls_layout;
static SinewBasisInfo info;
static size_t floats;
static int changed_count;

/* Details lie outside the arena: a refused call writes them, and only them. */
static SinewDetails details;

static inline void remember(void)
{
    memcpy(before, arena, ARENA_BYTES);
    memset(&details, 0, sizeof details);
    details.struct_bytes = sizeof details;
}

static inline void say(const char *what, SinewStatus status)
{
    int changed = status != SINEW_STATUS_OK && memcmp(before, arena, ARENA_BYTES) != 0;
    printf("%s: %s%s\n", what, sinew_status_name(status), changed ? " AND MEMORY HAS CHANGED" : "");
    if (changed) {
        changed_count++;
    }
    remember();
}

/* Where a call was given details, what they say. */
static inline void say_details(const char *what, SinewStatus status)
{
    if (status != details.status) {
        printf("details of another status\n");
        changed_count++;
    }
    printf("  %s | index %lu, expected %lu, actual %lu", details.text, (unsigned long)details.index,
           (unsigned long)details.expected, (unsigned long)details.actual);
    if (details.reason != SINEW_PACKAGE_REASON_NONE) {
        printf(", reason %ld", (long)details.reason);
    }
    printf("\n");
    say(what, status);
}

/* As say_details, where the sentence is not for a text that stays. */
static inline void say_reason(const char *what, SinewStatus status)
{
    printf("  reason %ld\n", (long)details.reason);
    say(what, status);
}

/* As say_details, where the numbers are of this package and not for a text that stays. */
static inline void say_numbers(const char *what, SinewStatus status, size_t expected, size_t actual)
{
    if (details.expected != expected || details.actual != actual) {
        printf("expected %lu, actual %lu\n", (unsigned long)details.expected, (unsigned long)details.actual);
        changed_count++;
    }
    say(what, status);
}

static inline void must(SinewStatus status)
{
    if (status != SINEW_STATUS_OK) {
        printf("preparation failed: %s\n", sinew_status_name(status));
        exit(2);
    }
}

static inline size_t load(const char *path, uint8_t *memory)
{
    FILE *file = fopen(path, "rb");
    size_t length;
    if (file == NULL) {
        exit(2);
    }
    length = fread(memory, 1, BLOCK_BYTES, file);
    fclose(file);
    return length;
}

/* Loads the packages, opens and creates what every program uses. */
static inline void prepare(int argc, char **argv)
{
    uint8_t *start, **blocks = &block.package;
    size_t at;
    allocated = calloc(1, ARENA_BYTES + 64);
    before = (uint8_t *)malloc(ARENA_BYTES);
    if (argc != 4 || allocated == NULL || before == NULL) {
        exit(2);
    }
    start = (uint8_t *)(((uintptr_t)allocated + 63) & ~(uintptr_t)63);
    arena = start;
    for (at = 0; at < sizeof block / sizeof(uint8_t *); at++) {
        blocks[at] = start + at * BLOCK_BYTES;
    }
    package_bytes = load(argv[1], block.package);
    other_bytes = load(argv[2], block.other);
    compact_bytes = load(argv[3], block.compact);

    must(sinew_basis_layout(&basis_layout));
    must(sinew_basis_open(SINEW_ABI_VERSION, block.package, package_bytes, block.basis, basis_layout.size_bytes, &basis,
                          NULL));
    must(sinew_basis_open(SINEW_ABI_VERSION, block.other, other_bytes, block.other_basis, BLOCK_BYTES, &other_basis,
                          NULL));
    must(sinew_workspace_layout(basis, NULL, &workspace_layout));
    must(sinew_controls_layout(basis, &controls_layout));
    must(sinew_workspace_create(basis, NULL, block.workspace, BLOCK_BYTES, &workspace, NULL));
    must(sinew_workspace_create(other_basis, NULL, block.other_workspace, BLOCK_BYTES, &other_workspace, NULL));
    must(sinew_controls_create(basis, block.controls, BLOCK_BYTES, &controls, NULL));
    must(sinew_controls_create(other_basis, block.other_controls, BLOCK_BYTES, &other_controls, NULL));
    info.struct_bytes = sizeof info;
    must(sinew_basis_info(basis, &info));
    floats = 3 * (size_t)info.vertex_count;
    remember();
}

static inline int finish(void)
{
    free(before);
    free(allocated);
    return changed_count == 0 ? 0 : 1;
}

#endif
