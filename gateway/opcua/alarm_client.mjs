// A small client of alarms, for a trial without an operator station:
//
//     node alarm_client.mjs --endpoint opc.tcp://HOST:4840 list
//     node alarm_client.mjs --endpoint ... --user anna ack FV-101 'fitter is on the way'
//     node alarm_client.mjs --endpoint ... --user anna shelve FV-101 8    (hours)
//     node alarm_client.mjs --endpoint ... --user anna unshelve FV-101
import {setTimeout as wait} from 'node:timers/promises';
import {parseArgs} from 'node:util';

const print = console.log;
console.log = console.error;  // The library talks there.
const {default: opcua} = await import('node-opcua-client');
const {OPCUACertificateManager} = await import('node-opcua-certificate-manager');

const {values: options, positionals: [verb, valve, text]} = parseArgs({allowPositionals: true,
  options: {endpoint: {type: 'string', default: 'opc.tcp://127.0.0.1:4840'},
    user: {type: 'string'}, security: {type: 'string'},
    pki: {type: 'string', default: 'opcua-client'}}});
const hourMs = 3_600_000;
const patienceMs = 10_000;

const store = new OPCUACertificateManager({rootFolder: options.pki,
  automaticallyAcceptUnknownCertificate: true});
await store.initialize();
const client = opcua.OPCUAClient.create({applicationName: 'fdi alarms', endpointMustExist: false,
  clientCertificateManager: store, connectionStrategy: {maxRetry: 0},
  securityMode: opcua.MessageSecurityMode[options.security ? 'SignAndEncrypt' : 'None'],
  securityPolicy: opcua.SecurityPolicy[options.security ?? 'None']});
const wordsOf = value => (value && typeof value === 'object' ? value.text : value) ?? '';
const show = ({conditionId, fields: f}) => print([f.sourceName.value, f.conditionName.value,
  `${wordsOf(f.activeState.value)}/${wordsOf(f.ackedState.value)}`,
  f.suppressedOrShelved.value ? 'Shelved' : '', f.severity.value, f.quality.value.name, wordsOf(f.message.value),
  wordsOf(f.clientUserId.value), wordsOf(f.comment.value)].join('\t'));

async function act(session, alarm) {
  if (verb === 'ack') return session.acknowledgeCondition(alarm.conditionId, alarm.eventId, text ?? '');
  const [shelving] = (await session.browse({nodeId: alarm.conditionId, resultMask: 63}))
    .references.filter(one => one.browseName.name === 'ShelvingState');
  const name = {shelve: 'TimedShelve', unshelve: 'Unshelve'}[verb];
  const [method] = (await session.browse({nodeId: shelving.nodeId, resultMask: 63}))
    .references.filter(one => one.browseName.name === name);
  return (await session.call({objectId: shelving.nodeId, methodId: method.nodeId,
    inputArguments: verb === 'shelve' ? [{dataType: opcua.DataType.Double, value: text * hourMs}] : []})).statusCode;
}

let code = 1;
try {
  await client.connect(options.endpoint);
  const session = await client.createSession(options.user && {userName: options.user,
    type: opcua.UserTokenType.UserName, password: process.env.OPCUA_PASSWORD});
  const list = await opcua.installAlarmMonitoring(session);
  await wait(1000);  // Time for the refresh.
  const retained = () => list.alarms().filter(alarm => alarm.getRetain());
  if (verb === 'list') {
    retained().forEach(show);
    code = 0;
  } else {
    let alarm;
    for (const end = Date.now() + patienceMs; !alarm && Date.now() < end; await wait(100))
      alarm = retained().find(one => one.fields.sourceName.value === valve);
    if (!alarm) throw Error(`no alarm of ${valve}`);
    const status = await act(session, alarm);
    print(`${verb} ${valve}: ${status.name}`);
    code = status.isGood() ? 0 : 1;
  }
  await session.close();
} catch (error) {
  console.error(`alarm_client: ${error.message.split('\n')[0]}`);
}
await Promise.race([client.disconnect().catch(() => {}), wait(2000)]);
process.exit(code);
