/* Publishes the rows of a CSV table as samples of a valve, with Eclipse Cyclone
   DDS. See README.md for what a publisher of fdi::v1::ValveSample has to mind.

   Usage: cyclone_publisher VALVE [DOMAIN [PERIOD_S [SPEED]]] <FILE.csv
   SPEED is a factor of real time; 0: as fast as the reader takes it. */
#define _GNU_SOURCE
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>

#include "cyclone.h"
#include "sample_table.h"

typedef struct {
  const char* valve;
  dds_domainid_t domain;
  double period_s;
  double speed;
} Options;

/* VOLATILE as the readers of fdi ask for; KEEP_ALL paces a fast writer. */
static dds_entity_t MakeWriter(dds_entity_t participant) {
  dds_qos_t* qos = MakeQos(DDS_DURABILITY_VOLATILE);
  dds_qset_resource_limits(qos, 1000, DDS_LENGTH_UNLIMITED,
                           DDS_LENGTH_UNLIMITED);
  /* The end of the program is the end of the stream, not a stale valve. */
  dds_qset_writer_data_lifecycle(qos, true);
  const dds_entity_t topic =
      Check(dds_create_topic(participant, &fdi_v1_ValveSample_desc,
                             "fdi/v1/ValveSample", qos, NULL),
            "topic");
  const dds_entity_t writer =
      Check(dds_create_writer(participant, topic, qos, NULL), "writer");
  dds_delete_qos(qos);
  return writer;
}

/* A volatile writer's samples are for those who listen: wait for the first. */
static void AwaitReader(dds_entity_t participant, dds_entity_t writer) {
  Check(dds_set_status_mask(writer, DDS_PUBLICATION_MATCHED_STATUS), "status");
  const dds_entity_t waitset = Check(dds_create_waitset(participant), "wait");
  Check(dds_waitset_attach(waitset, writer, writer), "wait");
  const dds_attach_t count =
      Check(dds_waitset_wait(waitset, NULL, 0, DDS_SECS(30)), "wait");
  dds_delete(waitset);
  if (count == 0) {
    fprintf(stderr, "cyclone_publisher: no reader within 30 s\n");
    exit(4);
  }
}

static void SleepUntil(const struct timespec* start, double seconds) {
  const int64_t ns = start->tv_nsec + (int64_t)(seconds * 1e9);
  const struct timespec until = {start->tv_sec + ns / 1000000000,
                                 ns % 1000000000};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
}

/* Writes all rows; @return their number. */
static uint64_t Publish(const Options* options, const SampleTable* table,
                        dds_entity_t writer) {
  fdi_v1_ValveSample sample;
  memset(&sample, 0, sizeof sample);
  strcpy(sample.valve_id, options->valve);
  /* A new source at each start: the monitor then expects no continuation. */
  if (getrandom(&sample.source_id, sizeof sample.source_id, 0) < 0) {
    perror("getrandom");
    exit(1);
  }
  sample.mode = fdi_v1_MODE_AUTO;
  struct timespec started;
  clock_gettime(CLOCK_MONOTONIC, &started);
  const int64_t start_ns = dds_time();
  while (ReadRow(stdin, table, &sample)) {
    const double t = (double)sample.seq * options->period_s;
    sample.stamp_ns = start_ns + (int64_t)(t * 1e9);
    if (options->speed > 0.0) {
      SleepUntil(&started, t / options->speed);
    }
    Check(dds_write(writer, &sample), "write");
    ++sample.seq;
  }
  Check(dds_dispose(writer, &sample), "dispose");
  return sample.seq;
}

static Options ParseOptions(int argc, char** argv) {
  if (argc < 2 || argc > 5 || strlen(argv[1]) > 64) {
    fprintf(stderr,
            "usage: cyclone_publisher VALVE [DOMAIN [PERIOD_S [SPEED]]] "
            "<FILE.csv\n");
    exit(2);
  }
  const Options options = {
      .valve = argv[1],
      .domain = argc > 2 ? (dds_domainid_t)strtoul(argv[2], NULL, 10) : 0,
      .period_s = argc > 3 ? strtod(argv[3], NULL) : 1.0,
      .speed = argc > 4 ? strtod(argv[4], NULL) : 1.0};
  return options;
}

int main(int argc, char** argv) {
  const Options options = ParseOptions(argc, argv);
  SampleTable table;
  if (!ReadHeader(stdin, &table)) {
    fprintf(stderr, "cyclone_publisher: no header with CV_pct and X_pct\n");
    return 3;
  }
  const dds_entity_t participant =
      Check(dds_create_participant(options.domain, NULL, NULL), "participant");
  const dds_entity_t writer = MakeWriter(participant);
  AwaitReader(participant, writer);
  const uint64_t count = Publish(&options, &table, writer);
  Check(dds_wait_for_acks(writer, DDS_SECS(30)), "acknowledgement");
  dds_delete(participant);
  printf("published %" PRIu64 " samples of %s\n", count, options.valve);
  return 0;
}
