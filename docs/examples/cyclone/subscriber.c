/* Prints the fault events of a monitor, a line each, with Eclipse Cyclone DDS.
   See README.md for what a subscriber of fdi::v1::FaultEvent has to mind.

   Usage: cyclone_subscriber [DOMAIN]           until it is interrupted */
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>

#include "cyclone.h"

enum { kAtOnce = 64 };

static volatile sig_atomic_t stopped = 0;

static void Stop(int signal_number) {
  (void)signal_number;
  stopped = 1;
}

/* TRANSIENT_LOCAL: the last events of every valve come at once, also those from
   before this program. */
static dds_entity_t MakeReader(dds_entity_t participant) {
  dds_qos_t* qos = MakeQos(DDS_DURABILITY_TRANSIENT_LOCAL);
  const dds_entity_t topic =
      Check(dds_create_topic(participant, &fdi_v1_FaultEvent_desc,
                             "fdi/v1/FaultEvent", qos, NULL),
            "topic");
  const dds_entity_t reader =
      Check(dds_create_reader(participant, topic, qos, NULL), "reader");
  dds_delete_qos(qos);
  return reader;
}

static const char* TransitionName(fdi_v1_Transition transition) {
  switch (transition) {
    case fdi_v1_TRANSITION_DETECTED:
      return "DETECTED";
    case fdi_v1_TRANSITION_ISOLATED:
      return "ISOLATED";
    case fdi_v1_TRANSITION_REISOLATED:
      return "REISOLATED";
    case fdi_v1_TRANSITION_CLEARED:
      return "CLEARED";
    case fdi_v1_TRANSITION_CLOSED:
      return "CLOSED";
  }
  return "?";
}

/* Prints what has arrived; @return how many events. */
static int PrintEvents(dds_entity_t reader) {
  void* samples[kAtOnce] = {NULL};
  dds_sample_info_t infos[kAtOnce];
  const int count =
      Check(dds_take(reader, samples, infos, kAtOnce, kAtOnce), "take");
  for (int i = 0; i < count; ++i) {
    if (!infos[i].valid_data) {
      continue;
    }
    const fdi_v1_FaultEvent* event = samples[i];
    printf("%016" PRIx64 " %s %" PRId64 " %s\n", event->episode_id,
           TransitionName(event->transition), event->stamp_ns, event->valve_id);
  }
  fflush(stdout);
  if (count > 0) {
    Check(dds_return_loan(reader, samples, count), "return");
  }
  return count;
}

int main(int argc, char** argv) {
  const dds_domainid_t domain =
      argc > 1 ? (dds_domainid_t)strtoul(argv[1], NULL, 10) : 0;
  signal(SIGINT, Stop);
  signal(SIGTERM, Stop);
  const dds_entity_t participant =
      Check(dds_create_participant(domain, NULL, NULL), "participant");
  const dds_entity_t reader = MakeReader(participant);
  const dds_entity_t arrived =
      Check(dds_create_readcondition(reader, DDS_NOT_READ_SAMPLE_STATE |
                                                 DDS_ANY_VIEW_STATE |
                                                 DDS_ANY_INSTANCE_STATE),
            "condition");
  const dds_entity_t waitset = Check(dds_create_waitset(participant), "wait");
  Check(dds_waitset_attach(waitset, arrived, reader), "wait");
  while (!stopped) {
    dds_attach_t triggered = 0;
    Check(dds_waitset_wait(waitset, &triggered, 1, DDS_MSECS(200)), "wait");
    while (PrintEvents(reader) > 0) {
    }
  }
  dds_delete(participant);
  return 0;
}
