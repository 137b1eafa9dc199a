/** Button whose action begins when it was held for a while, with a mouse, a touch or a key. */

import type { Hold } from "../logic/hold.ts";
import { confirmed } from "../parts/confirm.tsx";
import { text } from "../strings.ts";
import { isOtherButton } from "../views/axes/jog_controls.tsx";
import type { Target } from "./requests.ts";

const KEYS: readonly string[] = ["Enter", " "];

export interface HoldButtonProps {
  hold: Hold<Target>;
  target: Target;
  held: boolean;
  current: boolean | undefined; // true: the present mode; undefined: a preset
  description: string;
  disabled: boolean;
}

export function HoldButton({ hold, target, held, current, description, disabled }: HoldButtonProps) {
  const end = () => hold.end();
  const onPointerDown = (event: PointerEvent) => {
    if (event.button !== 0 || disabled) return;
    (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
    hold.begin(target);
  };
  const onKeyDown = (event: KeyboardEvent) => {
    if (!KEYS.includes(event.key) || event.altKey || event.ctrlKey || event.metaKey) {
      end(); // with such a key held, some systems do not report that the other key goes up
      return;
    }
    event.preventDefault(); // a short press must not click
    if (!event.repeat && !disabled) hold.begin(target);
  };
  const onKeyUp = (event: KeyboardEvent) => {
    if (KEYS.includes(event.key)) event.preventDefault();
    end();
  };
  return (
    <button
      type="button"
      class={held ? "button hold holding" : "button hold"}
      disabled={disabled}
      aria-pressed={current}
      title={description}
      onPointerDown={onPointerDown}
      onPointerUp={end}
      onPointerMove={(event) => isOtherButton(event) && end()}
      onPointerCancel={end}
      onLostPointerCapture={end}
      onKeyDown={onKeyDown}
      onKeyUp={onKeyUp}
      onBlur={end}
      onClick={(event) => event.detail === 0 && void ask(hold, target)}
      onContextMenu={(event) => event.preventDefault()}
    >
      <span>{target.name}</span>
      {description !== "" && <small>{description}</small>}
    </button>
  );
}

/** Confirm a click of assistive technology, which cannot hold a button, by a question. */
async function ask(hold: Hold<Target>, target: Target): Promise<void> {
  const { kinds, question, request } = text.operation;
  const title = question(`${kinds[target.kind]} ${target.name}`);
  if (await confirmed({ title, body: text.operation.hint, action: request })) hold.complete(target);
}
