// @(len(msgs)) messages, @(len(all_topics)) topics
enum class ORB_ID {
@[for index, topic in enumerate(all_topics)]@
	@topic = @index,
@[end for]@
};
