// A plant as an OPC UA server, for tests and measures: valves FV-101 on, each
// with six tags that take the rows of a table of fdi-simulator, RATE rows a
// second. Rows are a second apart in source time, and the last one is of now. The
// first valves have a table each, all others the last one.
// It listens on PLANT_HOST, or loopback, and stands until PLANT_BEGAN_MS.
// Usage: plant_server.mjs PORT VALVES RATE CSV...
import {readFileSync} from 'node:fs';
import {setTimeout as wait} from 'node:timers/promises';

console.log = console.error;  // The library talks there.
const {OPCUAServer} = await import('node-opcua-server');
const {DataType, StatusCodes, Variant} = await import('node-opcua-client');

const [port, valves, rate] = process.argv.slice(2, 5).map(Number);
const columns = {OP: 'CV_pct', ZT: 'X_pct', FT: 'F_m3_h', P1: 'P1_kPa', P2: 'P2_kPa', T1: 'T1_degC'};
function readTable(file) {
  const [names, ...rows] = readFileSync(file, 'utf8').trim().split('\n').map(line => line.split(','));
  const at = Object.values(columns).map(name => names.indexOf(name));
  return rows.map(row => at.map(i => Number(row[i])));
}
const tables = process.argv.slice(5).map(readTable);
const count = Math.min(...tables.map(table => table.length));

for (const signal of ['SIGTERM', 'SIGINT']) process.on(signal, () => process.exit(0));

const server = new OPCUAServer({port, host: process.env.PLANT_HOST ?? '127.0.0.1',
  serverCapabilities: {minSupportedSampleRate: 0}});
await server.initialize();
const space = server.engine.addressSpace;
const variables = Array.from({length: valves}, (_, i) => Object.keys(columns).map(name =>
  space.getOwnNamespace().addVariable({browseName: `FV-${101 + i}.${name}`, nodeId: `s=FV-${101 + i}.${name}`,
    organizedBy: space.rootFolder.objects, dataType: 'Double', minimumSamplingInterval: 0})));

// A program that is started again goes on where the clock is.
const beganMs = Number(process.env.PLANT_BEGAN_MS ?? Date.now());
const firstMs = beganMs - Math.round(1000 * (count - count / rate));
function show(row, stamp = new Date(firstMs + 1000 * row)) {
  variables.forEach((tags, i) => {
    const values = tables[Math.min(i, tables.length - 1)][row];
    tags.forEach((tag, j) => tag.setValueFromSource(
      new Variant({dataType: DataType.Double, value: values[j]}), StatusCodes.Good, stamp));
  });
}
// Before it begins, the plant stands.
if (Date.now() < beganMs) show(0, new Date(firstMs - beganMs + Date.now()));
await server.start();
console.error('plant_server: ready');
for (let row = Math.max(0, Math.ceil(rate * (Date.now() - beganMs) / 1000)); row < count; ++row) {
  await wait(Math.max(0, beganMs + 1000 * row / rate - Date.now()));
  show(row);
}
console.error('plant_server: all rows');
