#pragma once

// The evidence file history.db: who writes, who reads, what is in it.
#include "storage/history_editor.h"
#include "storage/history_reader.h"
#include "storage/history_schema.h"
#include "storage/history_trace.h"
#include "storage/history_types.h"
#include "storage/history_writer.h"
