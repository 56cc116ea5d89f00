// A simulated PLC (Modbus TCP): holds the rows of a CSV table of fdi-simulator
// in registers, as docs/examples/modbus_gateway/README.md lists them. Every
// second request finds the next row, so that a test is fast and counts exactly.
// Usage: modbus_plc CSV PORT
#include <math.h>
#include <modbus.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { kMaxRows = 1000 };
static double rows[kMaxRows][7];  // t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_m3_h

// Rows from .. to of what goes wrong.
static bool Within(int row, int from, int to) {
  return row >= from && row < to;
}

static void SetLong(uint16_t* at, uint32_t value) {
  at[0] = value >> 16;
  at[1] = value & 0xFFFF;
}

static void SetReal(uint16_t* at, double value) {
  const float real = (float)value;
  uint32_t pair = 0;
  memcpy(&pair, &real, sizeof pair);
  SetLong(at, pair);
}

static void Fill(int row, time_t start, uint16_t* at) {
  const double* v = rows[row];
  SetLong(at, (uint32_t)(start + row));
  at[2] = Within(row, 20, 30) ? 0 : 1;  // MANUAL, AUTO
  at[3] = (uint16_t)lround(100.0 * (100.0 - v[1]));
  at[4] = (uint16_t)lround(100.0 * (100.0 - v[5]));
  at[5] = (uint16_t)(Within(row, 50, 55) ? -32768 : lround(10.0 * v[4]));
  SetReal(&at[6], (v[2] - 101.325) / 100.0);
  SetReal(&at[8], (v[3] - 101.325) / 100.0);
  SetReal(&at[10], Within(row, 60, 64) ? NAN : 0.958 * v[6]);
}

int main(int argc, char** argv) {
  FILE* csv = argc == 3 ? fopen(argv[1], "r") : NULL;
  char line[1000];
  int count = -1;  // The header is none.
  for (; csv != NULL && count < kMaxRows && fgets(line, sizeof line, csv);
       ++count) {
    char* cell = line;
    for (int i = 0; i < 7 && count >= 0; ++i, ++cell)
      rows[count][i] = strtod(cell, &cell);
  }
  if (count < 1) return 2;

  const time_t start = time(NULL);
  modbus_t* plc = modbus_new_tcp("127.0.0.1", atoi(argv[2]));
  modbus_mapping_t* map = modbus_mapping_new(0, 0, 12, 0);
  int listener = modbus_tcp_listen(plc, 1);
  fprintf(stderr, "modbus_plc: ready %ld\n", (long)start);
  int row = 0;
  for (int requests = 0; modbus_tcp_accept(plc, &listener) >= 0;) {
    uint8_t query[MODBUS_TCP_MAX_ADU_LENGTH];
    for (int n = 0; (n = modbus_receive(plc, query)) >= 0; ++requests) {
      Fill(row, start, map->tab_registers);
      if (Within(row, 70, 73)) {
        modbus_reply_exception(plc, query, MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY);
      } else {
        modbus_reply(plc, query, n, map);
      }
      row += requests % 2 == 1 && row + 1 < count;
      if (row == 80) {
        row = 120;  // The connection is cut, and time goes on.
        break;
      }
    }
    modbus_close(plc);
  }
  return 1;
}
