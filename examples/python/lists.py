"""As in a notebook: what platforms do, see and write to each other; a task is ended by its name."""

import dyknow

fed = dyknow.connect().open()
begun = fed.delegate("monitor-proximity", to="0")
for task in fed.tasks():
    print(task.unit, task.task, task.state, task.conversation)
for seen in fed.objects():
    print(f"platform {seen.by} sees {seen.symbol}, a {seen.type}: {dict(seen.attributes)}")
for act in fed.acts(unit="0")[-1:]:
    print(act.direction, act.peer, act.act)
fed.cancel(begun.conversation)
print("left:", [task.task for task in fed.tasks()])
fed.close()
