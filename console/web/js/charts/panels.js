// Which lines stand in which panel of a trend, and how they look.

import {faultTitle} from '../faults.js';
import {unitText} from '../format.js';

const kDashes = [[], [8, 4], [2, 3], [10, 3, 2, 3]];
const kFaultColors = ['--s2', '--s3', '--s4', '--s5', '--s6'];
const kTallestResidualRows = 3;

function signalPanel(data) {
  const flow = unitText(data.meta.flow_unit);
  const lines = [
    ...data.has('pv') ? [] :
      [{column: 'sp', label: 'SP', unit: '%', color: '--s5', dash: [2, 3]}],
    {column: 'cv', label: 'CV', unit: '%', color: '--s5', dash: [6, 3]},
    {column: 'x', label: 'X', unit: '%', color: '--s1'},
    {column: 'x_hat', label: 'X expected', unit: '%', color: '--s1',
      dash: [2, 3]},
    {column: 'x_sim', label: 'X simulated', unit: '%', color: '--s4',
      dash: [10, 3, 2, 3]},
    {column: 'f', label: 'F', unit: flow, color: '--s2', scale: 'right'},
    {column: 'f_hat', label: 'F expected', unit: flow, color: '--s2',
      dash: [2, 3], scale: 'right'},
    {column: 'f_sim', label: 'F simulated', unit: flow, color: '--s3',
      dash: [10, 3, 2, 3], scale: 'right'},
  ];
  return {
    key: 'signals', title: `Signals: CV, X [%] left, F [${flow}] right`,
    height: 230, lines,
  };
}

// The set point of a loop with PV is in its unit, which nobody tells.
function loopPanel(data) {
  return {
    key: 'loop', title: 'Loop: PV and SP [unit of PV]', height: 150,
    lines: data.has('pv') ? [
      {column: 'sp', label: 'SP', unit: '', color: '--s5', dash: [2, 3]},
      {column: 'pv', label: 'PV', unit: '', color: '--s1'},
    ] : [],
  };
}

function processPanel() {
  return {
    key: 'process', title: 'Process: P1, P2 [kPa] left, T1 [°C] right',
    height: 150,
    lines: [
      {column: 'p1', label: 'P1', unit: 'kPa', color: '--s4'},
      {column: 'p2', label: 'P2', unit: 'kPa', color: '--s3', dash: [6, 3]},
      {column: 't1', label: 'T1', unit: '°C', color: '--s6', scale: 'right',
        dash: [2, 3]},
    ],
  };
}

function residualPanel({name, unit, low, high}, c, tall) {
  const text = unitText(unit);
  return {
    key: `r${c}`, height: tall ? 120 : 92,
    title: `Residual of ${name} [${text || '-'}], measured minus expected`,
    lines: [{column: `r${c}`, label: `r ${name}`, unit: text, color: '--s1'}],
    band: {low, high},
  };
}

function decisionPanel({faults, T}) {
  const lines = [{column: 'd0', label: 'normal', unit: '', color: '--s1'}];
  faults.forEach((fault, f) => lines.push({
    column: `d${f + 1}`, label: faultTitle(fault), fault, unit: '',
    color: kFaultColors[f % kFaultColors.length],
    dash: kDashes[Math.floor(f / kFaultColors.length) % kDashes.length],
  }));
  return {
    key: 'decision', title: 'How well each explains the data (above the dashed line: fits)',
    height: 220, lines, range: [-0.03, 1.05], threshold: T, ribbon: true,
  };
}

/**
 * Panels from top to bottom; lines without any value are left out, and unless
 * `everyFault` those of faults that never come near T.
 */
export function panelsOf(data, table, everyFault) {
  const {channels} = data.meta;
  const tall = channels.length <= kTallestResidualRows;
  const panels = [
    signalPanel(data), loopPanel(data), processPanel(),
    ...channels.map((channel, c) => residualPanel(channel, c, tall)),
    decisionPanel(data.meta),
  ];
  // The page of a plant has no readings, a loop with PV perhaps no X and F.
  const read = data.size === 0 || !data.has('pv') &&
      ['cv', 'x', 'f'].some((name) => data.has(name));
  const {T} = data.meta;
  for (const panel of panels) {
    panel.lines = panel.lines.filter(({column, fault}) =>
      (fault && !everyFault && T !== null ?
        table[column]?.some((value) => value >= T / 2) :
        table[column]?.some((value) => value !== null)) ||
      column === 'd0' || read && (column === 'x' || column === 'f') ||
      panel.band);
  }
  // Nobody asks which fault it is while there is none.
  return panels.filter(({key, lines}) => lines.length > 0 &&
      (key !== 'decision' || everyFault || lines.some(({fault}) => fault)));
}
