// Alarms as conditions of OPC 10000-9, of the types that OPC 10000-100 has for
// the classes of NE 107. The history of the monitor is what is true: a condition
// shows what it says of an episode, and a method writes to it.
import opcua from 'node-opcua-client';

import {store} from './programs.mjs';
import {dateOf, severities} from './valves.mjs';

const {StatusCodes} = opcua;

const types = {FAILURE: 'FailureAlarm', CHECK_FUNCTION: 'CheckFunctionAlarm',
  OFF_SPEC: 'OffSpecAlarm', MAINTENANCE_REQUIRED: 'MaintenanceRequiredAlarm'};
const eventsKept = 16;  // A client may acknowledge an episode by any of its last events.
const longestShelfMs = 90 * 86_400_000;  // As `fdi-store history shelve` has it.
const hourMs = 3_600_000;

// Codes with which fdi-store ends.
const answers = {2: StatusCodes.BadInvalidArgument, 5: StatusCodes.BadEventIdUnknown};

export class Alarms {
  #space;
  #namespace;
  #di;
  #operator;
  #slots = new Map();   // By id of the condition and of its shelving state.
  #acking = new Set();  // Episodes that we have acknowledged, until the history says so.

  // @param operator {nameOf(context), may(name), say(text)}
  constructor(space, operator) {
    this.#space = space;
    this.#namespace = space.registerNamespace('urn:fdi:valves');
    this.#di = space.getNamespaceIndex('http://opcfoundation.org/UA/DI/');
    this.#operator = operator;
    space.installAlarmsAndConditionsService();
    // A client may name a method of the type instead of that of the condition.
    this.#bind(space.findEventType('ConditionType'));
    this.#bind(space.findEventType('AcknowledgeableConditionType'));
    this.#bind(space.findEventType('AlarmConditionType').shelvingState);
    this.#bind(space.findObjectType('ShelvedStateMachineType'));
  }

  get healthType() { return this.#space.findDataType('DeviceHealthEnumeration', this.#di); }

  // Each episode that is not normal has a condition of its own, the first one of
  // its class. An episode that is normal again leaves it.
  show(valve, alarms, status) {
    if (!Array.isArray(alarms)) {
      for (const slot of valve.slots) if (slot.episode) this.#tell(slot, slot.alarm, StatusCodes.BadNoCommunication);
      return;
    }
    const wanted = new Map(alarms.map(alarm => [alarm.episode_id, alarm]));
    for (const slot of valve.slots) {
      const alarm = wanted.get(slot.episode);
      if (slot.episode && (!alarm || types[alarm.health] !== slot.type)) {
        this.#tell(slot, {...slot.alarm, ...alarm, state: 'NORMAL'}, status);
        slot.episode = null;
      }
    }
    for (const alarm of alarms) {
      const type = types[alarm.health] ?? types.CHECK_FUNCTION;
      let slot = valve.slots.find(one => one.episode === alarm.episode_id) ??
        valve.slots.find(one => !one.episode && one.type === type);
      if (!slot) valve.slots.push(slot = this.#add(valve, type));
      if (slot.episode !== alarm.episode_id)
        Object.assign(slot, {episode: alarm.episode_id, events: [], told: null});
      this.#tell(slot, alarm, alarm.unconfirmed_utc ? StatusCodes.UncertainLastUsableValue : status);
    }
    for (const {episode_id: id, acked_by: by} of alarms) if (by) this.#acking.delete(id);
  }

  #add(valve, type) {
    const like = valve.slots.filter(slot => slot.type === type).length;
    const name = type + (like > 0 ? like + 1 : '');
    const condition = this.#namespace.instantiateAlarmCondition(
      this.#space.findEventType(`${type}Type`, this.#di), {
        browseName: name, nodeId: `s=${valve.part}/${name}`, componentOf: valve.object,
        conditionSource: valve.object, conditionName: name,
        inputNode: valve.variables.DeviceHealth.nodeId, maxTimeShelved: longestShelfMs,
        optionals: ['ShelvingState', 'ShelvingState.UnshelveTime', 'ShelvingState.TimedShelve',
          'ShelvingState.OneShotShelve', 'ShelvingState.Unshelve']});
    condition.setSourceName(valve.id);  // The library says "3:FV-101".
    this.#bind(condition);
    this.#bind(condition.shelvingState);
    const slot = {valve: valve.id, type, condition, episode: null, events: [], told: null};
    this.#slots.set(condition.nodeId.toString(), slot);
    this.#slots.set(condition.shelvingState.nodeId.toString(), slot);
    return slot;
  }

  #tell(slot, alarm, quality) {
    slot.alarm = alarm;
    const {state, name, check, severity, acked_by: by, ack_comment: comment,
      shelved_until_utc: until, detected_utc: detected} = alarm;
    const now = JSON.stringify([state, name, severity, by, comment, until, quality.name]);
    if (slot.told === now) return;
    const active = state === 'UNACK' || state === 'ACKED';
    const acked = state === 'ACKED' || state === 'NORMAL';
    const branch = slot.condition.currentBranch();
    branch.setActiveState(active);
    branch.setAckedState(acked);
    branch.setComment(comment ?? '');
    branch.setClientUserId(by ?? '');
    this.#shelve(slot.condition.shelvingState, dateOf(until));
    slot.condition.raiseNewCondition({message: check ? `${name}: ${check}` : name,
      severity: severities[severity] ?? severities.medium, quality, retain: state !== 'NORMAL',
      time: slot.told === null ? dateOf(detected) ?? new Date() : new Date()});
    slot.told = now;
    slot.events = [branch.getEventId().toString('hex'), ...slot.events].slice(0, eventsKept);
  }

  #shelve(shelving, until) {
    const shelved = until !== null && until > Date.now();
    const state = shelved ? 'TimedShelved' : 'Unshelved';
    if (shelving.getCurrentState() !== state) shelving.setState(state);
    if (shelved) Object.assign(shelving, {_shelvedTime: new Date(), _duration: until - Date.now()});
  }

  // All methods that change something are ours; those that have no counterpart in
  // the history are refused.
  #bind(node) {
    const methods = {
      acknowledge: (slot, name, [event, comment]) => this.#acknowledge(slot, name, event.value, comment.value),
      timedShelve: (slot, name, [time]) => this.#timedShelve(slot, name, time.value),
      unshelve: (slot, name) => this.#unshelve(slot, name),
    };
    for (const refused of ['oneShotShelve', 'addComment', 'confirm', 'enable', 'disable'])
      methods[refused] = () => StatusCodes.BadNotSupported;
    for (const [method, act] of Object.entries(methods))
      node?.[method]?.bindMethod(async (args, context) => {
        const name = this.#operator.nameOf(context);
        if (!this.#operator.may(name)) return {statusCode: StatusCodes.BadUserAccessDenied};
        const slot = this.#slots.get(context.object?.nodeId.toString());
        if (!slot) return {statusCode: StatusCodes.BadNodeIdInvalid};
        const statusCode = await act(slot, name, args);
        this.#operator.say(`${method} valve=${slot.valve} episode=${slot.episode} ` +
          `user=${JSON.stringify(name)} ${statusCode.name}`);
        return {statusCode, outputArguments: []};
      });
  }

  async #acknowledge(slot, name, event, comment) {
    const {episode} = slot;
    if (!episode || !slot.events.includes(event?.toString('hex'))) return StatusCodes.BadEventIdUnknown;
    if (slot.alarm.acked_by || this.#acking.has(episode)) return StatusCodes.BadConditionBranchAlreadyAcked;
    this.#acking.add(episode);
    const answer = await this.#store('ack', episode, `--by=${name}`, `--comment=${comment?.text ?? ''}`);
    if (answer.isNotGood()) this.#acking.delete(episode);
    return answer;
  }

  async #timedShelve({valve, alarm}, name, durationMs) {
    if (!(durationMs > 0 && durationMs <= longestShelfMs)) return StatusCodes.BadShelvingTimeOutOfRange;
    if (alarm.shelved_until_utc) return StatusCodes.BadConditionAlreadyShelved;
    return this.#store('shelve', `--for=${durationMs / hourMs}h`, `--by=${name}`, '--', valve);
  }

  async #unshelve({valve, alarm}, name) {
    if (!alarm.shelved_until_utc) return StatusCodes.BadConditionNotShelved;
    return this.#store('shelve', '--off', `--by=${name}`, '--', valve);
  }

  async #store(verb, ...args) {
    try {
      const error = await store('history', verb, ...args);
      if (!error) return StatusCodes.Good;
      this.#operator.say(`fdi-store history ${verb}: ${error.text}`);
      return answers[error.code] ?? StatusCodes.BadInternalError;
    } catch (error) {  // A text with NUL cannot be an argument.
      return StatusCodes.BadInvalidArgument;
    }
  }
}
