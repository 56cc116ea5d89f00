#include "sample_table.h"

#include <stdlib.h>
#include <string.h>

enum { kLineLength = 4096 };

static const struct {
  const char* column;
  int signal;
} kColumns[] = {{"CV_pct", 0}, {"P1_kPa", 1}, {"P2_kPa", 2}, {"T1_degC", 3},
                {"X_pct", 4},  {"F_m3_h", 5}, {"F_t_h", 5},  {"SP_pct", 6}};

/* The next cell of the line that `rest` points into; NULL after the last. */
static char* NextCell(char** rest) {
  return *rest == NULL ? NULL : strsep(rest, ",");
}

bool ReadHeader(FILE* in, SampleTable* table) {
  char line[kLineLength];
  if (fgets(line, sizeof line, in) == NULL) {
    return false;
  }
  line[strcspn(line, "\r\n")] = '\0';
  table->columns = 0;
  table->flow_unit = fdi_v1_FLOW_M3_PER_H;
  unsigned found = 0;
  char* rest = line;
  for (char* name;
       (name = NextCell(&rest)) != NULL && table->columns < kMaxColumns;
       ++table->columns) {
    table->signal[table->columns] = -1;
    for (size_t i = 0; i < sizeof kColumns / sizeof *kColumns; ++i) {
      if (strcmp(name, kColumns[i].column) == 0) {
        table->signal[table->columns] = kColumns[i].signal;
        found |= 1U << kColumns[i].signal;
      }
    }
    if (strcmp(name, "F_t_h") == 0) {
      table->flow_unit = fdi_v1_FLOW_T_PER_H;
    }
  }
  return (found & (1U << 0)) != 0 && (found & (1U << 4)) != 0;
}

bool ReadRow(FILE* in, const SampleTable* table, fdi_v1_ValveSample* sample) {
  char line[kLineLength];
  if (fgets(line, sizeof line, in) == NULL) {
    return false;
  }
  line[strcspn(line, "\r\n")] = '\0';
  double* const values[kSignals] = {
      &sample->cv, &sample->p1, &sample->p2,  &sample->t1, &sample->x,
      &sample->f,  &sample->sp, &sample->cvi, &sample->ps, &sample->pz};
  sample->present = 0;
  sample->flow_unit = table->flow_unit;
  for (int signal = 0; signal < kSignals; ++signal) {
    *values[signal] = 0.0;
    sample->quality[signal] = fdi_v1_SIGNAL_BAD;
  }
  char* rest = line;
  for (int column = 0; column < table->columns; ++column) {
    const char* cell = NextCell(&rest);
    const int signal = table->signal[column];
    if (cell == NULL || *cell == '\0' || signal < 0) {
      continue;
    }
    *values[signal] = strtod(cell, NULL);
    sample->present |= (uint16_t)(1U << signal);
    sample->quality[signal] = fdi_v1_SIGNAL_GOOD;
  }
  return true;
}
