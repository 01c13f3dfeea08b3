"""Slow oracles for looping templates: all pairs of states, one frame after the other."""

import math

UNKNOWN = -1


def frame_cost(word, when_zero, when_one):
    """Cost of one word in one column, from the two rows of feature costs."""
    return sum(
        one if word >> i & 1 else zero
        for i, (zero, one) in enumerate(zip(when_zero, when_one, strict=True))
    )


def transition(a, b, lengths, jump_price):
    """Price from state a to state b; a state is (template, column, visit) or UNKNOWN."""
    if a == UNKNOWN and b == UNKNOWN:
        return 0.0
    prices = [math.inf]
    if b == UNKNOWN or b[2] == 0:
        prices.append(jump_price)
    if UNKNOWN not in (a, b) and a[0] == b[0]:
        length = lengths[a[0]]
        if b[2] == 1 and a[2] == 0 and a[1] == b[1]:
            prices.append(0.0)
        steps = (1, 2) if length > 3 else (1,)
        if b[2] == 0 and any((a[1] + step) % length == b[1] for step in steps):
            prices.append(0.0)
    return min(prices)


def best_total(words, zeros, ones, jump_price, unknown_price=math.inf):
    """Cost of the cheapest path: Viterbi over all pairs of states."""
    lengths = [len(template) for template in zeros]
    states = [
        (m, k, visit) for m, length in enumerate(lengths) for k in range(length) for visit in (0, 1)
    ]
    if unknown_price < math.inf:
        states.append(UNKNOWN)

    def cost(state, word):
        if state == UNKNOWN:
            return unknown_price
        m, k, _ = state
        return frame_cost(word, zeros[m][k], ones[m][k])

    sums = {s: cost(s, words[0]) if s == UNKNOWN or s[2] == 0 else math.inf for s in states}
    for word in words[1:]:
        sums = {
            b: cost(b, word) + min(sums[a] + transition(a, b, lengths, jump_price) for a in states)
            for b in states
        }
    return min(sums.values())


def path_total(words, columns, jumps, zeros, ones, jump_price, unknown_price=math.inf):
    """Cost of a path by the definition; infinite if it takes a step that is not allowed."""
    owner = [(m, k) for m, template in enumerate(zeros) for k in range(len(template))]
    total, visits = 0.0, 0
    for t, word in enumerate(words):
        c = columns[t]
        if c == UNKNOWN:
            total += unknown_price
        else:
            m, k = owner[c]
            total += frame_cost(word, zeros[m][k], ones[m][k])
        if t == 0:
            visits = 1
            continue
        before = columns[t - 1]
        if jumps[t]:
            total, visits = total + jump_price, 1
        elif c == UNKNOWN or before == UNKNOWN:
            total += 0.0 if c == before else math.inf
        else:
            n, j = owner[before]
            length = len(zeros[m])
            step = (k - j) % length
            if n != m:
                return math.inf
            if length == 1:  # a step of one leads to the column itself
                visits = 1
            elif step == 0:
                visits += 1
                if visits > 2:
                    return math.inf
            elif step == 1 or (step == 2 and length > 3):
                visits = 1
            else:
                return math.inf
    return total
