"""A task for platform 0: keep watch over how close the platforms come. It ends when it is cancelled."""

import dyknow

with dyknow.connect() as fed:
    try:
        task = fed.delegate("monitor-proximity", to="0", profile="proximity")
    except dyknow.Refused as refused:
        raise SystemExit(f"refused ({refused.code}): {refused}") from None
    print(task.conversation, task.state)
    while not (monitors := fed.monitors()):
        event = task.events.get(timeout_s=1.0)
        print("reported:", None if event is None else event.expr())
    print(len(monitors), "monitors")
    task.cancel()
    print(task.state)
