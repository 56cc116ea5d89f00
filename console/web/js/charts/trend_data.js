// The instants of one valve as columns of equal length, oldest first, as uPlot
// wants them. Where samples are missing a row of nulls breaks the lines.

const kCapacity = 7200;
const kSignals = [
  'cv', 'x', 'f', 'pv', 'sp', 'p1', 'p2', 't1', 'x_sim', 'f_sim'];
const kGapPeriods = 3;
const kMinGapMs = 2500;

function medianStep(t) {
  const steps = [];
  for (let i = Math.max(1, t.length - 100); i < t.length; ++i) {
    steps.push(t[i] - t[i - 1]);
  }
  steps.sort((a, b) => a - b);
  return steps[steps.length >> 1] ?? 1000;
}

function layoutOf({model_set: set, channels, faults}) {
  return JSON.stringify([set, channels, faults]);
}

/** Columns by name: t, signals, r0.. (residuals), d0, d1.. (faults). */
function columnsOf(trend) {
  const count = trend.t_ms.length;
  const columns = {t: trend.t_ms, state: trend.state, quality: trend.quality,
    d0: trend.d0};
  for (const name of kSignals) {
    columns[name] = trend[name] ?? new Array(count).fill(null);
  }
  trend.channels.forEach((_, c) => columns[`r${c}`] = trend.residuals[c]);
  trend.faults.forEach((_, f) => columns[`d${f + 1}`] = trend.d[f]);
  return columns;
}

export class TrendData {
  meta = {channels: [], faults: [], T: null, flow_unit: ''};
  gaps = [];
  marks = [];
  words = '';
  priority = 3;  // Of the alarm: the colour of its strip.
  columns = null;
  openGapFromMs = null;  // While nothing is heard.

  get size() {
    return this.columns?.t.length ?? 0;
  }

  get lastMs() {
    return this.size > 0 ? this.columns.t[this.size - 1] : null;
  }

  /**
   * Takes what the monitor has. With `keep`, what it no longer has stays, as
   * after a restart. @returns whether channels and faults are as before.
   */
  load(trend, keep) {
    const same = this.columns !== null &&
        layoutOf(this.meta) === layoutOf(trend);
    const fresh = columnsOf(trend);
    if (keep && same) this.#merge(fresh);
    else this.columns = fresh;
    this.meta = trend;
    this.words = trend.words ?? '';
    if (!keep || !same) {
      this.gaps = [];
      this.marks = [];
    }
    this.#addAll(this.gaps, trend.gaps, 'from_ms');
    this.#addAll(this.marks, trend.marks, 't_ms');
    return same;
  }

  #addAll(list, items, key) {
    for (const item of items ?? []) {
      if (!list.some((other) => other[key] === item[key] &&
          other.kind === item.kind)) list.push(item);
    }
  }

  // Old instants outside the span of the fresh ones stay.
  #merge(fresh) {
    const old = this.columns;
    if (fresh.t.length === 0) return;
    const before = old.t.findIndex((t) => t >= fresh.t[0]);
    const head = before < 0 ? old.t.length : before;
    const last = fresh.t[fresh.t.length - 1];
    const after = old.t.findIndex((t) => t > last);
    for (const name of Object.keys(fresh)) {
      fresh[name] = [...old[name].slice(0, head), ...fresh[name],
        ...(after < 0 ? [] : old[name].slice(after))];
    }
    this.columns = fresh;
  }

  /** Whether there are instants before the last one that it does not have. */
  goesBack(samples) {
    return samples.some(({t_ms: t}) =>
      t < this.lastMs && !this.columns.t.includes(t));
  }

  /** Appends what is newer than the last. */
  append(samples) {
    if (!this.columns) return;
    const {columns} = this;
    for (const sample of samples) {
      if (sample.t_ms <= (this.lastMs ?? -Infinity)) continue;
      columns.t.push(sample.t_ms);
      columns.state.push(sample.state);
      columns.quality.push(sample.quality);
      columns.d0.push(sample.d0 ?? null);
      for (const name of kSignals) columns[name].push(sample[name] ?? null);
      this.meta.channels.forEach((_, c) =>
        columns[`r${c}`].push(sample.residuals?.[c] ?? null));
      this.meta.faults.forEach((_, f) =>
        columns[`d${f + 1}`].push(sample.d?.[f] ?? null));
    }
    if (this.size > 1.1 * kCapacity) {
      for (const name of Object.keys(columns)) {
        columns[name] = columns[name].slice(-kCapacity);
      }
    }
  }

  addGap(gap) {
    this.#addAll(this.gaps, [gap], 'from_ms');
  }

  addMark(mark) {
    this.#addAll(this.marks, [mark], 't_ms');
  }

  has(name) {
    return this.columns?.[name]?.some((v) => v !== null) ?? false;
  }

  /** Where samples are missing, whether the monitor said so or not. */
  allGaps() {
    const found = [];
    const t = this.columns?.t ?? [];
    const limit = Math.max(kMinGapMs, kGapPeriods * medianStep(t));
    for (let i = 1; i < t.length; ++i) {
      if (t[i] - t[i - 1] > limit) {
        found.push({from_ms: t[i - 1], to_ms: t[i], reason: 'no samples'});
      }
    }
    const named = this.gaps.filter((gap) => !found.some(
        (f) => gap.from_ms < f.to_ms && gap.to_ms > f.from_ms));
    for (const gap of found) {
      const said = this.gaps.find(
          (g) => g.from_ms < gap.to_ms && g.to_ms > gap.from_ms);
      if (said) gap.reason = said.reason;
    }
    if (this.openGapFromMs !== null) {
      named.push({from_ms: this.openGapFromMs, to_ms: null,
        reason: 'no connection'});
    }
    return [...found, ...named].sort((a, b) => a.from_ms - b.from_ms);
  }

  /**
   * Columns to draw: with estimates ŷ = y − r, factors of faults only while an
   * episode is open (before it, a fault that looks normal is near 1, too), and
   * nulls within gaps.
   */
  table(gaps) {
    const {columns} = this;
    const table = {...columns};
    this.meta.channels.forEach(({name}, c) => {
      const signal = name.toLowerCase();
      if (!columns[signal]) return;
      table[`${signal}_hat`] = columns[signal].map((y, i) => {
        const r = columns[`r${c}`][i];
        return y === null || r === null ? null : y - r;
      });
    });
    this.meta.faults.forEach((_, f) => {
      table[`d${f + 1}`] = columns[`d${f + 1}`].map(
          (d, i) => columns.state[i] === 'NORMAL' ? null : d);
    });
    const cuts = gaps.filter((gap) => gap.to_ms !== null &&
        columns.t.some((t, i) => t >= gap.to_ms && i > 0 &&
            columns.t[i - 1] <= gap.from_ms));
    if (cuts.length === 0) return table;
    const at = cuts.map((gap) => columns.t.findIndex((t) => t > gap.from_ms));
    for (const name of Object.keys(table)) {
      const pieces = [];
      let from = 0;
      at.forEach((index, k) => {
        pieces.push(...table[name].slice(from, index), name === 't' ?
          (cuts[k].from_ms + cuts[k].to_ms) / 2 : null);
        from = index;
      });
      table[name] = [...pieces, ...table[name].slice(from)];
    }
    return table;
  }
}
