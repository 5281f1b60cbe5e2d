"""The duration of the longest path in a graph of states, with some edges of zero duration."""

from collections.abc import Sequence

Edges = Sequence[Sequence[tuple[int, int]]]


def components(edges: Edges) -> list[int]:
    """The number of each state's strongly connected component (Tarjan, 1972); an edge leads to the same or a lower."""
    index = [0] * len(edges)
    low = [0] * len(edges)
    found = [-1] * len(edges)
    stack: list[int] = []
    count = parts = 0
    for root in range(len(edges)):
        if index[root]:
            continue
        count += 1
        index[root] = low[root] = count
        stack.append(root)
        work = [(root, iter(edges[root]))]
        while work:
            state, rest = work[-1]
            for target, _ in rest:
                if not index[target]:
                    count += 1
                    index[target] = low[target] = count
                    stack.append(target)
                    work.append((target, iter(edges[target])))
                    break
                if found[target] < 0:
                    low[state] = min(low[state], index[target])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[state])
                if low[state] == index[state]:
                    while True:
                        member = stack.pop()
                        found[member] = parts
                        if member == state:
                            break
                    parts += 1
    return found


def longest(edges: Edges) -> tuple[list[int], list[int]]:
    """For each state, the longest time along any path from it; and the states from which time may pass for ever."""
    part = components(edges)
    times = [0] * (max(part, default=-1) + 1)
    endless = set()
    for state in sorted(range(len(edges)), key=part.__getitem__):
        for target, time in edges[state]:
            if part[target] == part[state]:
                if time:
                    endless.add(part[state])
            else:
                times[part[state]] = max(times[part[state]], times[part[target]] + time)
                if part[target] in endless:
                    endless.add(part[state])
    return [times[number] for number in part], [state for state, number in enumerate(part) if number in endless]
