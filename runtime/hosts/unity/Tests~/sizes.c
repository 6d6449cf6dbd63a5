/* Sizes of the structs that Native.cs repeats, one a line. */
#include <stdio.h>

#include "sinew.h"
#include "sinew_pins.h"

#define SAY(name) printf(#name " %zu\n", sizeof(Sinew##name))

int main(void)
{
    SAY(Layout);
    SAY(Details);
    SAY(BasisInfo);
    SAY(WorkspaceOptions);
    SAY(FrameOptions);
    SAY(FrameReport);
    SAY(VertexOptions);
    SAY(DragReport);
    return 0;
}
