/* What the examples share: to give up with a reason, memory at the alignment of handles, files. Build: see sinew.h. */
#ifndef EXAMPLE_H
#define EXAMPLE_H

#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sinew.h"

static inline void fail(const char *what, const char *why)
{
    fprintf(stderr, "%s: %s\n", what, why);
    exit(EXIT_FAILURE);
}

static inline void check(const char *what, SinewStatus status, const SinewDetails *details)
{
    if (status != SINEW_STATUS_OK) {
        fail(what, details != NULL ? details->text : sinew_status_text(status));
    }
}

/* Memory at a multiple of 64 bytes, which is enough for every handle and package. `*start` is what to free. */
static inline void *allocate(size_t size_bytes, void **start)
{
    *start = malloc(size_bytes + 64);
    if (*start == NULL) {
        fail("memory", "none left");
    }
    return (void *)(((uintptr_t)*start + 63) & ~(uintptr_t)63);
}

static inline FILE *open_file(const char *path, const char *mode)
{
    FILE *file = fopen(path, mode);
    if (file == NULL) {
        fail(path, strerror(errno));
    }
    return file;
}

static inline void *read_file(const char *path, size_t *length, void **start)
{
    FILE *file = open_file(path, "rb");
    void *bytes;
    long end;
    if (fseek(file, 0, SEEK_END) != 0 || (end = ftell(file)) < 0) {
        fail(path, strerror(errno));
    }
    rewind(file);
    *length = (size_t)end;
    bytes = allocate(*length, start);
    if (fread(bytes, 1, *length, file) != *length) {
        fail(path, "cannot be read to its end");
    }
    fclose(file);
    return bytes;
}

/* Writes meshes of one package, one after the other; normals may be NULL. */
static inline void write_obj(const char *path, const SinewBasis *basis, const float *positions, const float *normals,
                             uint32_t mesh_count)
{
    SinewBasisInfo info = SINEW_INIT(SinewBasisInfo);
    uint32_t *indices;
    size_t vertex_count, index_count, at;
    uint32_t mesh;
    FILE *file = open_file(path, "w");
    check("info", sinew_basis_info(basis, &info), NULL);
    vertex_count = (size_t)mesh_count * info.vertex_count;
    index_count = 3 * (size_t)info.face_count;
    indices = (uint32_t *)malloc(index_count * sizeof *indices);
    if (indices == NULL) {
        fail("memory", "none left");
    }
    check("faces", sinew_basis_faces(basis, SINEW_WINDING_COUNTER_CLOCKWISE, indices, index_count), NULL);
    for (at = 0; at < 3 * vertex_count; at += 3) {
        fprintf(file, "v %.9g %.9g %.9g\n", positions[at], positions[at + 1], positions[at + 2]);
    }
    for (at = 0; normals != NULL && at < 3 * vertex_count; at += 3) {
        fprintf(file, "vn %.9g %.9g %.9g\n", normals[at], normals[at + 1], normals[at + 2]);
    }
    for (mesh = 0; mesh < mesh_count; mesh++) {
        for (at = 0; at < index_count; at++) {
            /* OBJ counts from one. */
            unsigned long vertex = (unsigned long)mesh * info.vertex_count + indices[at] + 1;
            fprintf(file, normals != NULL ? "%s%lu//%lu" : "%s%lu", at % 3 == 0 ? "f " : " ", vertex, vertex);
            if (at % 3 == 2) {
                fprintf(file, "\n");
            }
        }
    }
    free(indices);
    if (fclose(file) != 0) {
        fail(path, "cannot be written to its end");
    }
}

#endif
