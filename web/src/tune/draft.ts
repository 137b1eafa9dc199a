/** Edited parameters of a law: applied together, with undo. */

export interface Parameter {
  value: number | number[];
  minimum: number | null;
  maximum: number | null;
  unit: string;
}

export type Parameters = Readonly<Record<string, Parameter>>;
export type Values = Record<string, number | number[]>;

const UNDO = 50; // applied sets that are kept

/** Owns the edits of one law and the values before each application. */
export class Draft {
  private edits = new Map<string, (number | undefined)[]>();
  private readonly history: Values[] = [];

  constructor(private parameters: Parameters) {}

  /** Take new values of the law. Edits remain. */
  update(parameters: Parameters): void {
    this.parameters = parameters;
  }

  /** Return the edited value of an element, or the present one. */
  value(name: string, index: number): number {
    return this.edits.get(name)?.[index] ?? present(this.parameters[name]!)[index]!;
  }

  set(name: string, index: number, value: number): void {
    const edits = this.edits.get(name) ?? [];
    edits[index] = value === present(this.parameters[name]!)[index] ? undefined : value;
    this.edits.set(name, edits);
  }

  isEdited(name: string, index: number): boolean {
    return this.edits.get(name)?.[index] !== undefined;
  }

  /** Number of edited elements. */
  get edited(): number {
    return [...this.edits.values()].flat().filter((each) => each !== undefined).length;
  }

  /** Return the edited parameters as a whole; arrays with all their elements. */
  changes(): Values {
    const changes: Values = {};
    for (const [name, parameter] of Object.entries(this.parameters)) {
      const values = present(parameter).map((_, index) => this.value(name, index));
      if (!values.some((_, index) => this.isEdited(name, index))) continue;
      changes[name] = Array.isArray(parameter.value) ? values : values[0]!;
    }
    return changes;
  }

  /** Return true if each value is a number within its limits. */
  isValid(): boolean {
    return Object.entries(this.parameters).every(([name, parameter]) =>
      present(parameter).every((_, index) => isAllowed(parameter, this.value(name, index))));
  }

  /** Drop all edits. */
  reset(): void {
    this.edits.clear();
  }

  /** The changes were applied: keep the values before for undo. */
  applied(changes: Values): void {
    const before = Object.keys(changes).map((name) => [name, this.parameters[name]!.value]);
    this.history.push(Object.fromEntries(before) as Values);
    if (this.history.length > UNDO) this.history.shift();
    this.edits.clear();
  }

  get canUndo(): boolean {
    return this.history.length > 0;
  }

  /** Return the values before the last application. */
  lastValues(): Values {
    return this.history.at(-1) ?? {};
  }

  /** The last values were applied again. */
  undone(): void {
    this.history.pop();
    this.edits.clear();
  }
}

export function present(parameter: Parameter): number[] {
  return Array.isArray(parameter.value) ? parameter.value : [parameter.value];
}

export function isAllowed({ minimum, maximum }: Parameter, value: number): boolean {
  return Number.isFinite(value) && value >= (minimum ?? -Infinity) && value <= (maximum ?? Infinity);
}

/** Return the ends of a slider: the limits, else a range around the present value. */
export function sliderRange(parameter: Parameter, value: number): [number, number] {
  const size = Math.max(Math.abs(value), 1e-6);
  const low = parameter.minimum ?? (value < 0 ? -4 * size : 0);
  const high = parameter.maximum ?? 4 * size;
  return [low, Math.max(high, low + 1e-9)];
}
