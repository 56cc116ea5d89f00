/* Samples of a valve out of a CSV table. */
#ifndef SAMPLE_TABLE_H
#define SAMPLE_TABLE_H

#include <stdbool.h>
#include <stdio.h>

#include "fdi_v1.h"

enum { kSignals = 10, kMaxColumns = 64 };

/* What the header of a table says: the signal of each column, its bit number in
   ValveSample.present, or -1 for a column that is no signal. */
typedef struct {
  int signal[kMaxColumns];
  int columns;
  fdi_v1_FlowUnit flow_unit;
} SampleTable;

/* Reads the header, e.g. "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_m3_h".
   False if it has neither CV_pct nor X_pct. */
bool ReadHeader(FILE* in, SampleTable* table);

/* Reads the next row into the signals, `present` and `quality` of `sample`. An
   empty cell leaves its signal out. False at the end. */
bool ReadRow(FILE* in, const SampleTable* table, fdi_v1_ValveSample* sample);

#endif
