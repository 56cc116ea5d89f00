/* What the publisher and the subscriber have in common. */
#ifndef CYCLONE_H
#define CYCLONE_H

#include "dds/dds.h"
#include "fdi_v1.h"

/* Ends the program with what Cyclone says about a failed call. */
dds_return_t Check(dds_return_t result, const char* what);

/* RELIABLE and KEEP_ALL: nothing is overwritten before it is acknowledged, or
   read. XCDR1, for Fast DDS 2.9 knows no other: with XCDR2 no peer is found. */
dds_qos_t* MakeQos(dds_durability_kind_t durability);

#endif
