#pragma once

namespace fdi::report {
class Program;
}

namespace fdi::gateway {

/// `in`: readings of the plant become samples on the bus.
void AddInVerb(report::Program& program);

/// `out`: findings of all monitors go to a broker.
void AddOutVerb(report::Program& program);

}  // namespace fdi::gateway
