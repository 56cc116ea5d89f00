// A simulated OPC UA server: gives the rows of a CSV table of fdi-simulator, in
// the tags and units of gateway.sh, one a second of the source
// time and every 10 ms. Goes on while somebody subscribes to all tags. Its
// namespace urn:plant has another number after each start, and the tag NOTE.SP a
// text.
// Usage: opcua_server.mjs CSV PORT [CERTIFICATE KEY]
import {readFileSync} from 'node:fs';

console.log = console.error;
const {OPCUAServer} = await import('node-opcua-server');
const {DataType, StatusCodes, Variant} = await import('node-opcua-client');

const [header, ...lines] = readFileSync(process.argv[2], 'utf8').trim().split('\n');
const names = header.split(',');
const rows = lines.map(line =>
  Object.fromEntries(line.split(',').map((cell, i) => [names[i], Number(cell)])));
const opening = name => row => 100 - row[name];
const barGauge = name => row => (row[name] - 101.325) / 100;
const tags = {
  'FIC101.OP': opening('CV_pct'),
  'PT101.PV': barGauge('P1_kPa'),
  'PT102.PV': barGauge('P2_kPa'),
  'TT101.PV': row => row.T1_degC,
  'ZT101.PV': opening('X_pct'),
  'FT101.PV': row => row.F_m3_h / 3.6,
};
const manual = [20, 30];    // rows from .. to, in the mode MANUAL
const bad = [50, 55];       // rows without a position
const uncertain = [60, 64];
const down = [80, 120];     // rows that the server does not live to see
const within = (at, [from, to]) => at >= from && at < to;

const startMs = 1000 * Math.floor(Date.now() / 1000);
let variables, starts = 0;
function give(at) {
  const stamp = new Date(startMs + 1000 * at);
  const set = (name, dataType, value, status = StatusCodes.Good) =>
    variables[name].setValueFromSource(new Variant({dataType, value}), status, stamp);
  for (const [name, reading] of Object.entries(tags)) {
    const position = name === 'ZT101.PV';
    set(name, DataType.Double, reading(rows[at]),
      position && within(at, bad) ? StatusCodes.BadSensorFailure :
      position && within(at, uncertain) ? StatusCodes.UncertainSensorNotAccurate :
      StatusCodes.Good);
  }
  set('FIC101.MODE', DataType.Int32, within(at, manual) ? 0 : 1);
  set('NOTE.SP', DataType.String, 'ask the operator');
}

async function start() {
  const [port, certificateFile, privateKeyFile] = process.argv.slice(3);
  const server = new OPCUAServer({port: Number(port), host: '127.0.0.1', certificateFile, privateKeyFile,
    serverCapabilities: {minSupportedSampleRate: 0}});
  await server.initialize();
  for (let i = 0; i < starts; ++i) server.engine.addressSpace.registerNamespace(`urn:other:${i}`);
  ++starts;
  const space = server.engine.addressSpace.registerNamespace('urn:plant');
  variables = {};
  for (const name of [...Object.keys(tags), 'FIC101.MODE', 'NOTE.SP'])
    variables[name] = space.addVariable({browseName: name, nodeId: `s=${name}`,
      organizedBy: server.engine.addressSpace.rootFolder.objects,
      dataType: {MODE: 'Int32', SP: 'String'}[name.split('.')[1]] ?? 'Double', minimumSamplingInterval: 0});
  return server;
}
const subscribed = server => {
  let items = 0;
  for (const session of Object.values(server.engine._sessions ?? {}))
    for (const subscription of session.publishEngine?.subscriptions ?? [])
      if (subscription.publishingEnabled) items += subscription.monitoredItemCount;
  return items >= Object.keys(variables).length;
};
const wait = milliseconds => new Promise(resolve => { setTimeout(resolve, milliseconds); });

let server = await start();
give(0);
await server.start();
console.error(`opcua_server: ready ${startMs / 1000}`);
for (let at = 1; at < rows.length; ++at) {
  do await wait(10); while (!subscribed(server));
  if (at === down[0]) {
    await wait(200);  // The client fetches the values given so far.
    await server.shutdown(0);
    server = await start();
    at = down[1];
    give(at);
    await server.start();
  } else {
    give(at);
  }
}
