// The table that is being made: visits in their order, each state a value, so that undo and redo are steps in a list. It belongs to the
// tab and survives going from page to page.

const KEY = 'darm-draft';
// States that undo can bring back.
const MOST = 200;

const EMPTY = { visits: [], mayRest: false };

function load() {
  try {
    return JSON.parse(sessionStorage.getItem(KEY)) ?? { states: [EMPTY], at: 0 };
  } catch {
    return { states: [EMPTY], at: 0 };
  }
}

export class Draft {
  constructor() {
    this.load();
  }

  // What another page of the tab has made of it since.
  load() {
    Object.assign(this, load());
  }

  // Gives each visit an angle for every servo: the draft of a tab may be of another arm, which the server had before.
  fit(servos) {
    const fitted = (visit) => ({ ...visit, servosDeg: Array.from({ length: servos }, (_, k) => visit.servosDeg[k] ?? 0) });
    this.states = this.states.map((state) => ({ ...state, visits: state.visits.map(fitted) }));
  }

  get now() {
    return this.states[this.at];
  }

  // The next state; what was undone is gone.
  become(state) {
    if (JSON.stringify(state) === JSON.stringify(this.now)) return;
    this.states = [...this.states.slice(0, this.at + 1), state].slice(-MOST);
    this.at = this.states.length - 1;
    this.save();
  }

  canStep(by) {
    return this.states[this.at + by] !== undefined;
  }

  // Undo by -1, redo by 1.
  step(by) {
    if (!this.canStep(by)) return;
    this.at += by;
    this.save();
  }

  save() {
    try {
      sessionStorage.setItem(KEY, JSON.stringify({ states: this.states, at: this.at }));
    } catch {
      // Too long for the storage of the tab: it lasts as long as this page.
    }
  }
}

// A visit to this word at the end.
export function withVisit(state, visit) {
  return { ...state, visits: [...state.visits, visit] };
}
